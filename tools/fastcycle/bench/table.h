#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace fastcycle::tool::bench {

/// One column of the displayed table: a key of the JSON row.
struct Column {
  std::string title;
  std::string key;
  int decimals = 1;
  bool has_quartiles = false;  ///< Over the rounds, behind the median: `48 [31, 60]`.
};

/// The `Column::key` for the ratio to the floor of the same round.
inline constexpr const char* kRatioKey = "ratio";

/// Rows of several rounds: each cell is the median over the rounds; counts that must be zero, such
/// as "lost", are summed.
class Table {
 public:
  /// With `is_upright` there is one line for each column.
  explicit Table(std::vector<Column> columns, bool is_upright = false)
      : columns_(std::move(columns)), is_upright_(is_upright) {}

  /// `place` orders the lines; rows of the same place are rounds of one line.
  void add(std::pair<std::size_t, std::size_t> place, nlohmann::json row);

  [[nodiscard]] std::string to_text() const;

 private:
  using Cells = std::vector<std::vector<std::string>>;
  using Rounds = std::vector<nlohmann::json>;
  [[nodiscard]] static std::string cell(const Column& column, const Rounds& rounds);

  [[nodiscard]] Cells cells() const;

  std::vector<Column> columns_;
  bool is_upright_;
  std::map<std::pair<std::size_t, std::size_t>, Rounds> lines_;
};

/// The middle value, or the mean of the two middle ones. @pre `values` is not empty.
[[nodiscard]] double median(std::vector<double> values);

/// "32 KiB"
[[nodiscard]] std::string size_text(std::int64_t bytes);

}  // namespace fastcycle::tool::bench
