#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "top/model.h"
#include "top/screen.h"

namespace fastcycle::tool::top {

/// Title and format of one column.
struct Heading {
  const char* title = "";
  const char* meaning = "";  ///< For the help.
  int width = 0;             ///< Of its numbers; the minimum of a text, which gets the rest.
  /// On a narrow screen the columns with the largest rank are dropped first; rank 0 always stays.
  int rank = 0;
  bool is_text = false;
};

struct Field {
  std::string text;
  double number = 0;  ///< To sort by, if the column is no text.
  Tone tone = Tone::kPlain;
};

struct Line {
  std::string name;
  std::vector<Field> fields;  ///< One for each heading.
};

/// One view of a model: rows of text, which can be sorted by any column.
struct Table {
  std::vector<Heading> headings;
  std::vector<Line> lines;
};

[[nodiscard]] Table component_table(const Model& model);
[[nodiscard]] Table topic_table(const Model& model);
[[nodiscard]] Table chain_table(const Model& model);
[[nodiscard]] Table process_table(const Model& model);

/// Keeps the lines whose name or other text contains `filter`, ignoring case.
void keep_matching(Table& table, const std::string& filter);

/// Sorts by a column: texts from A to Z, numbers in descending order, or the reverse. Equal lines
/// keep the model's order.
void sort_by(Table& table, std::size_t column, bool is_reversed);

/// The columns that fit a screen of `width`, in their order.
[[nodiscard]] std::vector<std::size_t> columns_that_fit(const Table& table, int width);

}  // namespace fastcycle::tool::top
