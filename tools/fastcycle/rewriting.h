#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "archive/rewrite.h"

namespace fastcycle::tool {

/// The common options of the commands that read logs and write others: convert, filter, merge,
/// split.
struct Rewriting {
  std::string command;
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;  ///< For split: the prefix of the output names.
  bool is_forced = false;
  bool is_quiet = false;

  std::string compression = "lz4";
  std::string chunk_size = "1MiB";

  archive::Layout layout;
  archive::Selection selection;

  /// Adds all options except the files.
  void add_options(CLI::App& line);

  /// Evaluates the options. Returns an error message; empty if they are valid.
  [[nodiscard]] std::string find_wrong();

  /// Executes the command. Returns the exit code.
  int run();

 private:
  [[nodiscard]] std::filesystem::path path_of(std::uint64_t number) const;
};

/// Sets the compression of `chunk`. Returns an error message; empty if `name` is a known one.
[[nodiscard]] std::string read_compression(const std::string& name, mcap::ChunkOptions& chunk);

/// Parses the time `text` of `option`; an empty one is accepted. Returns an error message, or "".
[[nodiscard]] std::string read_offset(const std::string& option, const std::string& text,
                                      std::optional<std::uint64_t>& offset_ns);

}  // namespace fastcycle::tool
