#pragma once

#include <string>

#include "top/model.h"
#include "top/screen.h"
#include "top/view.h"

namespace fastcycle::tool::top {

/// What a terminal of this size shows of `model`. It depends on nothing else.
[[nodiscard]] Screen lay_out(const Model& model, const View& view, int width, int height);

/// How many rows of a table a terminal of this height has room for,
[[nodiscard]] int table_rows(int height);
/// and how many of the help or the details;
[[nodiscard]] int text_rows(int height);
/// how many lines these have.
[[nodiscard]] int text_lines(const Model& model, const View& view);

/// All pages one below the other, for a file or a pipe: `width` columns, as many lines as it takes.
[[nodiscard]] std::string to_text(const Model& model, int width);

}  // namespace fastcycle::tool::top
