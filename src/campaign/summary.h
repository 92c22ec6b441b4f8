#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "campaign/plan.h"

namespace fastcycle::campaign {

/// The result of one seed.
struct SeedResult {
  std::uint64_t seed = 0;
  std::vector<DrawnFault> faults;
  std::string way;  ///< As in `Verdict`; empty: it passed.
  std::string how;
  double wall_s = 0;
};

/// Converts to a line of `results.jsonl`, and back. Exceptions of the JSON library propagate.
[[nodiscard]] std::string to_line(const SeedResult& result);
[[nodiscard]] SeedResult result_of(const std::string& line);

/// A failure that was shrunk.
struct Failure {
  std::uint64_t seed = 0;
  std::vector<DrawnFault> faults;  ///< The fewest that fail; empty: it needs none.
  std::string way;
  std::string how;
  std::size_t runs = 0;  ///< Needed for shrinking.
  bool is_smallest = true;
  std::string overlay;  ///< A file.
  std::string log;      ///< The same; empty if none was written.
  std::string command;  ///< Reproduces it.
};

/// Whether they are of one kind: they fail in the same way, by the same kinds of faults on the same
/// targets, with as many messages.
[[nodiscard]] bool is_alike(const Failure& one, const Failure& other);

/// What is said of a failure that needs no fault.
inline constexpr const char* kWithoutFaults = "fails without any fault";
/// Whether a run that fails in this way fails without any fault too, according to `failures`.
[[nodiscard]] bool fails_without_faults(const std::string& way,
                                        const std::vector<Failure>& failures);

/// Short text of a fault: `drop lidar/points, messages 41 42`.
[[nodiscard]] std::string in_words(const nlohmann::ordered_json& fault);
/// The topic, component or process that has a fault.
[[nodiscard]] std::string target_of(const nlohmann::ordered_json& fault);

/// The results of a campaign.
struct Summary {
  std::string application;
  std::string plan;
  std::uint64_t seeds = 0;  ///< The requested number.
  std::vector<std::string> judges;
  std::vector<SeedResult> results;  ///< By seed.
  std::vector<Failure> failures;    ///< The different ones.
  double wall_s = 0;                ///< Of all runs of seeds together.

  [[nodiscard]] std::size_t failed() const;
};

/// How many failed of those that ran, by kind and target of a fault and by when it began.
struct FaultTable {
  struct Cell {
    std::size_t failed = 0;
    std::size_t ran = 0;
  };
  struct Row {
    std::string name;  ///< Kind and target.
    std::vector<Cell> cells;
    Cell all;
  };
  double begin_s = 0;
  double width_s = 1;  ///< Of a column.
  std::vector<Row> rows;
};
[[nodiscard]] FaultTable make_table(const Summary& summary, std::size_t columns = 8);

/// For people, in text.
[[nodiscard]] std::string to_text(const Summary& summary);
[[nodiscard]] nlohmann::ordered_json to_json(const Summary& summary);
/// For CI: a test case for each seed.
[[nodiscard]] std::string to_junit(const Summary& summary);

}  // namespace fastcycle::campaign
