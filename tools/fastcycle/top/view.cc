#include "top/view.h"

#include <algorithm>

#include "top/layout.h"
#include "top/text.h"

namespace fastcycle::tool::top {
namespace {

using Kind = Key::Kind;

constexpr std::size_t kCpuColumn = 3;
constexpr std::size_t kRateColumn = 2;
constexpr std::size_t kBreachColumn = 8;
constexpr std::size_t kProcessCpuColumn = 2;
constexpr std::size_t kFilterLongest = 64;

void go_to_page(View& view, const Model& model, std::size_t page) {
  const std::vector<Page> pages = pages_of(model);
  view.page = pages[page % pages.size()];
  view.shows_details = false;
}

/// Sorts by the next column that is shown, to the right or to the left.
void move_order(View& view, const Model& model, int width, int by) {
  const std::vector<std::size_t> columns = columns_that_fit(table_of(model, view), width);
  const auto count = static_cast<int>(columns.size());
  const auto now = std::find(columns.begin(), columns.end(), view.order().column);
  // A column that is hidden since the screen became narrower counts as the first.
  const int place = now == columns.end() ? 0 : static_cast<int>(now - columns.begin());
  view.order().column = columns[static_cast<std::size_t>((place + by + count) % count)];
  view.order().is_reversed = false;
}

/// Moves the selection by so many rows; the first row is selected if none was.
void move_selection(View& view, const Model& model, int by) {
  const std::vector<Line> lines = table_of(model, view).lines;
  if (lines.empty()) {
    return;
  }
  const auto now = std::find_if(lines.begin(), lines.end(), [&](const Line& line) {
    return line.name == view.order().selected;
  });
  const auto last = static_cast<std::ptrdiff_t>(lines.size()) - 1;
  const std::ptrdiff_t place =
      now == lines.end() ? (by > 0 ? by - 1 : by) : now - lines.begin() + by;
  view.order().selected =
      lines[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(place, 0, last))].name;
}

void type_filter(View& view, const Key& key) {
  if (key.kind == Kind::kText && view.filter.size() < kFilterLongest) {
    view.filter += key.text;
  } else if (key.kind == Kind::kBackspace && !view.filter.empty()) {
    std::string shorter;
    const std::vector<Glyph> glyphs = glyphs_of(view.filter);
    for (std::size_t i = 0; i + 1 < glyphs.size(); ++i) {
      shorter += glyphs[i].bytes;
    }
    view.filter = shorter;
  } else if (key.kind == Kind::kEnter) {
    view.is_typing_filter = false;
  } else if (key.kind == Kind::kEscape) {
    view.is_typing_filter = false;
    view.filter.clear();
  }
}

/// Goes back by one: from the details, from the filter, from the selection.
void go_back(View& view) {
  if (view.shows_details) {
    view.shows_details = false;
  } else if (!view.filter.empty()) {
    view.filter.clear();
  } else {
    view.order().selected.clear();
  }
}

/// Keys that move: in the help and the details the text, else the selection.
void move(View& view, const Model& model, int by, int height) {
  if (view.shows_help || view.shows_details) {
    const int last = std::max(0, text_lines(model, view) - text_rows(height));
    view.scrolled = std::clamp(view.scrolled + by, 0, last);
  } else {
    move_selection(view, model, by);
  }
}

void show_details(View& view, const Model& model) {
  if (view.order().selected.empty()) {
    move_selection(view, model, 1);
  }
  view.shows_details = !view.order().selected.empty();
  view.scrolled = 0;
}

/// Handles letters and signs. Returns false to quit.
bool press_text(View& view, const std::string& text, const Model& model, int width, int height) {
  if (text == "q" || text == "Q") {
    return false;
  }
  if (text == "?" || text == "h") {
    view.shows_help = !view.shows_help;
    view.scrolled = 0;
  } else if (text == " ") {
    view.is_paused = !view.is_paused;
  } else if (text == "/") {
    view.is_typing_filter = true;
    view.shows_details = false;
  } else if (text == "<" || text == ",") {
    move_order(view, model, width, -1);
  } else if (text == ">" || text == ".") {
    move_order(view, model, width, 1);
  } else if (text == "r" || text == "R") {
    view.order().is_reversed = !view.order().is_reversed;
  } else if (text == "j") {
    move(view, model, 1, height);
  } else if (text == "k") {
    move(view, model, -1, height);
  } else if (text.size() == 1 && text[0] >= '1' &&
             text[0] < '1' + static_cast<int>(pages_of(model).size())) {
    go_to_page(view, model, static_cast<std::size_t>(text[0] - '1'));
  }
  return true;
}

}  // namespace

std::vector<Page> pages_of(const Model& model) {
  std::vector<Page> pages = {Page::kComponents, Page::kTopics};
  if (!model.chains.empty()) {
    pages.push_back(Page::kChains);
  }
  if (!model.processes.empty()) {
    pages.push_back(Page::kProcesses);
  }
  return pages;
}

View first_view() {
  View view;
  view.orders[static_cast<std::size_t>(Page::kComponents)].column = kCpuColumn;
  view.orders[static_cast<std::size_t>(Page::kTopics)].column = kRateColumn;
  view.orders[static_cast<std::size_t>(Page::kChains)].column = kBreachColumn;
  view.orders[static_cast<std::size_t>(Page::kProcesses)].column = kProcessCpuColumn;
  return view;
}

Table table_of(const Model& model, const View& view) {
  Table table = view.page == Page::kComponents ? component_table(model)
                : view.page == Page::kTopics   ? topic_table(model)
                : view.page == Page::kChains   ? chain_table(model)
                                               : process_table(model);
  keep_matching(table, view.filter);
  sort_by(table, view.order().column, view.order().is_reversed);
  return table;
}

bool press(View& view, const Key& key, const Model& model, int width, int height) {
  if (view.is_typing_filter && key.kind <= Kind::kBackspace && key.kind != Kind::kTab &&
      key.kind != Kind::kBackTab) {
    type_filter(view, key);
    return true;
  }
  if (view.shows_help && (key.kind == Kind::kEscape || key.kind == Kind::kEnter)) {
    view.shows_help = false;
    return true;
  }
  const std::vector<Page> pages = pages_of(model);
  const auto page =
      static_cast<std::size_t>(std::ranges::find(pages, view.page) - pages.begin()) % pages.size();
  const int many = std::max(table_rows(height) - 1, 1);
  constexpr int kAll = 1'000'000;  // More rows than any table has.
  switch (key.kind) {
    case Kind::kText:
      return press_text(view, key.text, model, width, height);
    case Kind::kTab:
      go_to_page(view, model, page + 1);
      break;
    case Kind::kBackTab:
      go_to_page(view, model, page + pages.size() - 1);
      break;
    case Kind::kEnter:
      show_details(view, model);
      break;
    case Kind::kEscape:
    case Kind::kBackspace:
      go_back(view);
      break;
    case Kind::kUp:
      move(view, model, -1, height);
      break;
    case Kind::kDown:
      move(view, model, 1, height);
      break;
    case Kind::kPageUp:
      move(view, model, -many, height);
      break;
    case Kind::kPageDown:
      move(view, model, many, height);
      break;
    case Kind::kHome:
      move(view, model, -kAll, height);
      break;
    case Kind::kEnd:
      move(view, model, kAll, height);
      break;
    case Kind::kLeft:
      move_order(view, model, width, -1);
      break;
    case Kind::kRight:
      move_order(view, model, width, 1);
      break;
    case Kind::kOther:
      break;
  }
  return true;
}

}  // namespace fastcycle::tool::top
