#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "fastcycle/time.h"

namespace fastcycle::tool::bench {

/// The options of `fastcycle bench`.
struct Options {
  std::string mode;
  std::vector<std::string> size_words;  ///< As written: 64, 32K, 4M.
  std::optional<std::int64_t> given_count;
  std::optional<std::int64_t> given_warmup;
  std::optional<std::int64_t> given_interval_us;
  std::int64_t rounds = 1;
  std::int64_t first_round = 1;
  std::vector<std::string> waits;
  std::int64_t load = 0;
  bool is_fifo = false;
  std::int64_t slice_us = 0;
  std::string floors = "default";
  bool is_json = false;
  bool prints_application = false;
  std::filesystem::path raw_file;

  std::vector<std::int64_t> subs = {1, 2, 4, 8, 16, 32, 64};
  std::vector<std::int64_t> hops = {1, 2, 4, 8};
  bool has_processes = false;
  bool has_no_credits = false;
  std::int64_t window = 1024;
  std::string clock = "live";
  std::int64_t components = 12;
  std::int64_t topics = 24;
  std::string idle_word = "10s";
  std::filesystem::path record_folder;  ///< As given; else the default of the mode.
  std::filesystem::path source_folder;  ///< Memory, if there is such a folder.

  // Set from the above by `complete`.
  std::vector<std::int64_t> sizes;
  std::int64_t count = 0;
  std::int64_t warmup = 0;
  std::int64_t interval_us = 0;
  Duration idle{};

  [[nodiscard]] bool is_simulated() const { return clock == "simulated"; }
};

/// Declares all options; `options` outlives the parsing.
void add_options(CLI::App& line, Options& options);

/// Fills in what the mode implies. Returns what is wrong and what would be right; empty if all is
/// valid.
[[nodiscard]] std::string complete(Options& options, const CLI::App& line);

/// The queue depth of a subscriber: the larger the messages, the smaller, so that their memory
/// stays below 16 MiB; at least 4.
[[nodiscard]] std::int64_t depth_for(std::int64_t size);

}  // namespace fastcycle::tool::bench
