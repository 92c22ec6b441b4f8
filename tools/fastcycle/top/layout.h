#pragma once

#include <string>

#include "top/model.h"
#include "top/screen.h"
#include "top/view.h"

namespace fastcycle::tool::top {

/// The screen that shows `model` on a terminal of this size. A pure function.
[[nodiscard]] Screen lay_out(const Model& model, const View& view, int width, int height);

/// How many rows of a table fit on a terminal of this height,
[[nodiscard]] int table_rows(int height);
/// and how many of the help or the details;
[[nodiscard]] int text_rows(int height);
/// and how many lines these have.
[[nodiscard]] int text_lines(const Model& model, const View& view);

/// All pages one below the other, for a file or a pipe: `width` columns, any number of lines.
[[nodiscard]] std::string to_text(const Model& model, int width);

}  // namespace fastcycle::tool::top
