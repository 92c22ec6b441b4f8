#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "archive/rewrite.h"

namespace fastcycle::tool {

/// What the commands have in common that read logs and write others: convert, filter, merge, split.
struct Rewriting {
  std::string command;
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;  ///< Of split: what its names begin with.
  bool is_forced = false;
  bool is_quiet = false;

  std::string compression = "lz4";
  std::string chunk_size = "1MiB";

  archive::Layout layout;
  archive::Selection selection;

  /// The words for all but the files.
  void add_options(CLI::App& line);

  /// Takes what the options say; a sentence if it is wrong.
  [[nodiscard]] std::string find_wrong();

  /// Does it; the exit code.
  int run();

 private:
  [[nodiscard]] std::filesystem::path path_of(std::uint64_t number) const;
};

/// Why `name` names no way to compress; empty if it does, which `chunk` gets.
[[nodiscard]] std::string read_compression(const std::string& name, mcap::ChunkOptions& chunk);

/// Why `text` is no time in a log; empty if it is one, or empty itself. `option` is its name.
[[nodiscard]] std::string read_offset(const std::string& option, const std::string& text,
                                      std::optional<std::uint64_t>& offset_ns);

}  // namespace fastcycle::tool
