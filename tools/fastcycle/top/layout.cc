#include "top/layout.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "top/table.h"
#include "top/text.h"

namespace fastcycle::tool::top {
namespace {

// Of a screen: two rows about the application, one with the pages; the keys are at the bottom.
constexpr int kPagesRow = 2;
constexpr int kBodyRow = 3;
constexpr int kFooterRows = 1;

struct Piece {
  std::string text;
  Tone tone = Tone::kPlain;
};

/// Writes pieces with two blanks in between, the first ones first: what has no room is left out.
int put_pieces(Screen& screen, int row, const std::vector<Piece>& pieces, int end) {
  int column = 0;
  for (const Piece& piece : pieces) {
    const int width = width_of(piece.text);
    if (piece.text.empty() || column + width > end) {
      continue;
    }
    column = screen.put(column, row, piece.text, piece.tone) + 2;
  }
  return column;
}

std::string or_dash(std::optional<double> number, std::string (*text)(double)) {
  return number ? text(*number) : "-";
}

Piece count_piece(const char* name, std::uint64_t count, Tone alarm) {
  return {fmt::format("{} {}", name, count_text(count)), count > 0 ? alarm : Tone::kPlain};
}

void put_header(Screen& screen, const Model& model, const View& view) {
  const std::string right = !view.notice.empty() ? view.notice : view.is_paused ? "PAUSED" : "";
  screen.put_right(screen.width(), 0, right, view.notice.empty() ? Tone::kWarning : Tone::kBad);
  const int end = screen.width() - (right.empty() ? 0 : width_of(right) + 1);
  const std::string name = shortened(model.application, std::max(8, std::min(end - 2, 40)));
  put_pieces(screen, 0,
             {{name, Tone::kStrong},
              {model.mode.empty() ? "" : "mode " + model.mode},
              {model.end.empty() ? "" : "ends: " + model.end, Tone::kWarning},
              {"up " + clock_text(model.up_s)},
              {model.clock == "live" ? "" : model.clock + " clock"},
              {fmt::format("pid {}", model.pid), Tone::kQuiet}},
             end);
  put_pieces(
      screen, 1,
      {{fmt::format("CPU {} %", or_dash(model.cpu_percent, percent_text))},
       {"RSS " + size_text(model.rss_bytes)},
       count_piece("dropped", model.dropped, Tone::kBad),
       count_piece("faults", model.faults, Tone::kBad),
       {or_dash(model.messages_hz, rate_text) + " msg/s"},
       {model.cpus == 0 ? "" : fmt::format("of {} CPUs", model.cpus), Tone::kQuiet},
       {model.processes.empty() ? "" : fmt::format("{} processes", model.processes.size()),
        Tone::kQuiet},
       {model.interval_s ? fmt::format("over {:.1f} s", *model.interval_s) : "", Tone::kQuiet}},
      screen.width());
}

std::string page_title(const Model& model, Page page) {
  switch (page) {
    case Page::kComponents:
      return fmt::format("Components {}", model.components.size());
    case Page::kTopics:
      return fmt::format("Topics {}", model.topics.size());
    case Page::kChains:
      return fmt::format("Chains {}", model.chains.size());
    case Page::kProcesses:
      return fmt::format("Processes {}", model.processes.size());
  }
  return {};
}

void put_pages(Screen& screen, const Model& model, const View& view) {
  int column = 0;
  int number = 0;
  for (const Page page : pages_of(model)) {
    const bool is_chosen = page == view.page;
    const std::string title = fmt::format(" {} {} ", ++number, page_title(model, page));
    column = screen.put(column, kPagesRow, title, is_chosen ? Tone::kBarStrong : Tone::kBar);
  }
  if (view.is_typing_filter || !view.filter.empty()) {
    const std::string filter = " filter: " + view.filter + (view.is_typing_filter ? "_ " : " ");
    screen.put(column + 1, kPagesRow, shortened(filter, screen.width() - column - 1),
               Tone::kWarning);
  }
}

/// Where a column is, and how wide.
struct Place {
  std::size_t column = 0;
  int left = 0;
  int width = 0;
};

/// Numbers get their width. The rest is distributed to the texts, as far as they need it, in order.
std::vector<Place> places_of(const Table& table, int width) {
  std::vector<Place> places;
  int left_over = width + 1;
  for (const std::size_t column : columns_that_fit(table, width)) {
    places.push_back({column, 0, table.headings[column].width});
    left_over -= table.headings[column].width + 1;
  }
  for (Place& place : places) {
    if (!table.headings[place.column].is_text) {
      continue;
    }
    int longest = place.width;
    for (const Line& line : table.lines) {
      longest = std::max(longest, width_of(line.fields[place.column].text));
    }
    const int more = std::min(longest - place.width, std::max(left_over, 0));
    place.width += more;
    left_over -= more;
  }
  int left = 0;
  for (Place& place : places) {
    place.left = left;
    place.width = std::min(place.width, width - left);  // One column on a very narrow screen.
    left += place.width + 1;
  }
  return places;
}

void put_headings(Screen& screen, int row, const Table& table, const std::vector<Place>& places,
                  const View::Order& order) {
  for (const Place& place : places) {
    const Heading& heading = table.headings[place.column];
    const bool is_order = place.column == order.column;
    const Tone tone = is_order ? Tone::kBarStrong : Tone::kBar;
    // Texts go up, numbers go down.
    const std::string mark = !is_order ? "" : heading.is_text != order.is_reversed ? "▲" : "▼";
    // The mark of a number's column may stand on the blank before it.
    const int room = place.width + (heading.is_text ? 0 : 1) - width_of(mark);
    const std::string title = shortened(heading.title, room) + mark;
    if (heading.is_text) {
      screen.put(place.left, row, title, tone);
    } else {
      screen.put_right(place.left + place.width, row, title, tone);
    }
  }
  screen.fill(row, Tone::kBar);
}

void put_line(Screen& screen, int row, const Table& table, const std::vector<Place>& places,
              const Line& line, bool is_selected) {
  for (const Place& place : places) {
    const Field& field = line.fields[place.column];
    const Tone tone = is_selected ? Tone::kSelected : field.tone;
    if (!table.headings[place.column].is_text) {
      screen.put_right(place.left + place.width, row, shortened(field.text, place.width), tone);
    } else if (place.column == 0) {
      screen.put(place.left, row, shortened_name(field.text, place.width), tone);
    } else {
      screen.put(place.left, row, shortened(field.text, place.width), tone);
    }
  }
  if (is_selected) {
    screen.fill(row, Tone::kSelected);
  }
}

const char* nothing_text(const View& view) {
  return !view.filter.empty()             ? "nothing matches the filter; Esc clears it"
         : view.page == Page::kComponents ? "no components"
         : view.page == Page::kTopics     ? "no topics"
                                          : "no chains";
}

void put_table(Screen& screen, const Model& model, const View& view) {
  const Table table = table_of(model, view);
  const std::vector<Place> places = places_of(table, screen.width());
  put_headings(screen, kBodyRow, table, places, view.order());
  if (table.lines.empty()) {
    screen.put(0, kBodyRow + 1, nothing_text(view), Tone::kQuiet);
  }
  const int rows = table_rows(screen.height());
  const auto count = static_cast<int>(table.lines.size());
  const auto selected = std::find_if(table.lines.begin(), table.lines.end(), [&](const Line& line) {
    return line.name == view.order().selected;
  });
  // The selected row stays in the middle, but at both ends.
  const int place =
      selected == table.lines.end() ? 0 : static_cast<int>(selected - table.lines.begin());
  const int first = std::clamp(place - rows / 2, 0, std::max(0, count - rows));
  for (int i = first; i < std::min(count, first + rows); ++i) {
    const Line& line = table.lines[static_cast<std::size_t>(i)];
    put_line(screen, kBodyRow + 1 + i - first, table, places, line,
             !view.order().selected.empty() && line.name == view.order().selected);
  }
  if (count > rows && rows > 0) {
    const std::string where =
        fmt::format(" {}-{} of {} ", first + 1, std::min(count, first + rows), count);
    screen.put_right(screen.width(), kPagesRow, where, Tone::kQuiet);
  }
}

// ------------------------------------------------------------------ help and details: lines of
// text

using TextLine = std::vector<Piece>;

std::vector<TextLine> help_lines(const Model& model, const View& view) {
  std::vector<TextLine> lines;
  const auto add = [&](const char* key, const char* meaning) {
    lines.push_back({{fmt::format("{:<14}", key), Tone::kStrong}, {meaning}});
  };
  lines.push_back({{"Keys", Tone::kStrong}});
  add("Tab 1 2 3 4", "next page, or page 1 to 4");
  add("Up Down j k", "select a row; PgUp PgDn Home End");
  add("Enter", "details of the selected row; Esc goes back");
  add("< > Left Right", "sort by another column");
  add("r", "reverse the sort order");
  add("/", "filter by text; Esc clears it");
  add("Space", "pause, go on");
  add("q Ctrl-C", "the end");
  lines.emplace_back();
  lines.push_back({{"Columns (-: nothing counted, or unknown)", Tone::kStrong}});
  for (const Heading& heading : table_of(model, view).headings) {
    add(heading.title, heading.meaning);
  }
  return lines;
}

TextLine fact(const char* name, std::string text, Tone tone = Tone::kPlain) {
  return {{fmt::format("{:<14}", name), Tone::kQuiet}, {std::move(text), tone}};
}

std::string times_text(const std::optional<Times>& times) {
  return times ? fmt::format("p50 {}   p99 {}   max {}", time_text(times->p50_ns),
                             time_text(times->p99_ns), time_text(times->max_ns))
               : "-";
}

std::string joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) {
    all += (all.empty() ? "" : ", ") + text;
  }
  return all.empty() ? "-" : all;
}

std::vector<TextLine> component_lines(const Model& model, const ComponentRow& row) {
  std::vector<TextLine> lines{
      fact("component", row.name, Tone::kStrong),
      fact("state", row.state + (row.health.empty() ? "" : ", health " + row.health)),
      fact("executor", row.executor.empty() ? "-" : row.executor),
      fact("process", row.process.empty() ? "main" : row.process),
      fact("CPU", or_dash(row.cpu_percent, percent_text) + " %"),
      fact("activations",
           fmt::format("{}, {} a second", row.activations, or_dash(row.activations_hz, rate_text))),
      fact("callback time", times_text(row.callback)),
      fact("lateness", times_text(row.lateness)),
      fact("overruns", fmt::format("{}", row.overruns)),
      fact("queued", fmt::format("{}", row.queued)),
      fact("faults", fmt::format("{}, {} restarts", row.faults, row.restarts),
           row.faults > 0 ? Tone::kBad : Tone::kPlain)};
  if (!row.remark.empty()) {
    lines.push_back(fact("remark", row.remark, Tone::kWarning));
  }
  for (const CallbackRow& callback : row.callbacks) {
    lines.push_back(fact("callback", fmt::format("{} {}   {}", callback.kind, callback.name,
                                                 times_text(callback.time))));
  }
  for (const TopicRow& topic : model.topics) {
    if (std::find(topic.publishers.begin(), topic.publishers.end(), row.name) !=
        topic.publishers.end()) {
      lines.push_back(fact("publishes", fmt::format("{}   {} a second", topic.name,
                                                    or_dash(topic.rate_hz, rate_text))));
    }
  }
  for (const TopicRow& topic : model.topics) {
    for (const SubscriberRow& subscriber : topic.subscribers) {
      if (subscriber.component == row.name) {
        lines.push_back(fact(
            "subscribes",
            fmt::format("{}   queue {}/{}   lost {}   latency {}", topic.name, subscriber.queued,
                        subscriber.depth, subscriber.dropped, times_text(subscriber.latency)),
            subscriber.dropped > 0 ? Tone::kBad : Tone::kPlain));
      }
    }
  }
  return lines;
}

std::vector<TextLine> topic_lines(const TopicRow& row) {
  std::vector<TextLine> lines{fact("topic", row.name, Tone::kStrong), fact("type", row.type),
                              fact("publishers", joined(row.publishers)),
                              fact("published", fmt::format("{}, {} a second", row.published,
                                                            or_dash(row.rate_hz, rate_text)))};
  if (row.bytes_per_s) {
    lines.push_back(fact("bandwidth", size_text(*row.bytes_per_s) + "/s"));
  }
  for (const SubscriberRow& subscriber : row.subscribers) {
    lines.emplace_back();
    lines.push_back(fact("subscriber",
                         fmt::format("{} ({})", subscriber.component, subscriber.kind),
                         Tone::kStrong));
    lines.push_back(fact("  latency", times_text(subscriber.latency)));
    lines.push_back(fact("  delivered", fmt::format("{}", subscriber.delivered)));
    lines.push_back(fact("  queue", fmt::format("{} of {}", subscriber.queued, subscriber.depth)));
    for (const auto& [reason, count] : subscriber.drops) {
      lines.push_back(fact("  lost", fmt::format("{} by {}", count, reason), Tone::kBad));
    }
  }
  return lines;
}

std::vector<TextLine> chain_lines(const ChainRow& row) {
  std::vector<TextLine> lines{
      fact("chain", row.name, Tone::kStrong), fact("from, to", row.from + ", " + row.to),
      fact("deadline", fmt::format("{}, on breach: {}", time_text(row.deadline_ns), row.on_breach)),
      fact("age", times_text(row.age)),
      fact("breaches", fmt::format("{} of {}, {} dropped", row.breaches, row.count, row.dropped),
           row.breaches > 0 ? Tone::kBad : Tone::kPlain)};
  for (const HopRow& hop : row.hops) {
    lines.emplace_back();
    lines.push_back(fact("hop",
                         hop.component + (hop.topic.empty() ? "" : ", publishes " + hop.topic),
                         Tone::kStrong));
    lines.push_back(fact("  waiting", times_text(hop.waiting)));
    if (hop.running) {
      lines.push_back(fact("  running", times_text(hop.running)));
    }
    if (hop.breaches > 0) {
      lines.push_back(
          fact("  breaches", fmt::format("largest contributor to {}", hop.breaches), Tone::kBad));
    }
  }
  return lines;
}

std::vector<TextLine> process_lines(const ProcessRow& row) {
  std::vector<TextLine> lines{
      fact("process", row.name, Tone::kStrong),
      fact("pid", fmt::format("{}", row.pid)),
      fact("CPU", or_dash(row.cpu_percent, percent_text) + " %"),
      fact("RSS", size_text(row.rss_bytes)),
      fact("open files", row.open_files == 0 ? "-" : fmt::format("{}", row.open_files)),
      fact("components", joined(row.components))};
  lines.emplace_back();
  for (const ThreadRow& thread : row.threads) {
    lines.push_back(
        fact("thread", fmt::format("{}{}   CPU {} %", thread.name,
                                   thread.count == 1 ? "" : fmt::format(" ({})", thread.count),
                                   or_dash(thread.cpu_percent, percent_text))));
  }
  return lines;
}

template <typename Row>
const Row* find_row(const std::vector<Row>& rows, const std::string& name) {
  const auto found =
      std::find_if(rows.begin(), rows.end(), [&](const Row& row) { return row.name == name; });
  return found == rows.end() ? nullptr : &*found;
}

std::vector<TextLine> detail_lines(const Model& model, const View& view) {
  const std::string& name = view.order().selected;
  if (const auto* component = find_row(model.components, name);
      component != nullptr && view.page == Page::kComponents) {
    return component_lines(model, *component);
  }
  if (const auto* topic = find_row(model.topics, name);
      topic != nullptr && view.page == Page::kTopics) {
    return topic_lines(*topic);
  }
  if (const auto* chain = find_row(model.chains, name);
      chain != nullptr && view.page == Page::kChains) {
    return chain_lines(*chain);
  }
  if (const auto* process = find_row(model.processes, name);
      process != nullptr && view.page == Page::kProcesses) {
    return process_lines(*process);
  }
  return {{{name + " no longer exists", Tone::kQuiet}}};
}

std::vector<TextLine> lines_of(const Model& model, const View& view) {
  return view.shows_help ? help_lines(model, view) : detail_lines(model, view);
}

void put_lines(Screen& screen, const Model& model, const View& view) {
  const std::vector<TextLine> lines = lines_of(model, view);
  const int rows = text_rows(screen.height());
  const auto count = static_cast<int>(lines.size());
  const int first = std::clamp(view.scrolled, 0, std::max(0, count - rows));
  for (int i = first; i < std::min(count, first + rows); ++i) {
    int column = 0;
    for (const Piece& piece : lines[static_cast<std::size_t>(i)]) {
      column = screen.put(column, kBodyRow + i - first,
                          shortened(piece.text, screen.width() - column), piece.tone) +
               1;
    }
  }
  if (count > rows && rows > 0) {
    screen.put_right(screen.width(), kPagesRow,
                     fmt::format(" {}-{} of {} ", first + 1, std::min(count, first + rows), count),
                     Tone::kQuiet);
  }
}

void put_footer(Screen& screen, const View& view) {
  const int row = screen.height() - 1;
  using Keys = std::vector<std::pair<const char*, const char*>>;
  const Keys keys = view.is_typing_filter ? Keys{{"Enter", "keep"}, {"Esc", "no filter"}}
                    : view.shows_help || view.shows_details
                        ? Keys{{"Esc", "back"}, {"Up Down", "scroll"}, {"q", "quit"}}
                        : Keys{{"q", "quit"},
                               {"?", "help"},
                               {"Tab", "page"},
                               {"<>", "sort"},
                               {"r", "flip"},
                               {"/", "filter"},
                               {"Space", view.is_paused ? "go on" : "pause"},
                               {"Enter", "more"}};
  int column = 0;
  for (const auto& [key, meaning] : keys) {
    if (column + width_of(key) + width_of(meaning) + 3 > screen.width()) {
      break;
    }
    column = screen.put(column, row, fmt::format(" {} ", key), Tone::kBarStrong);
    column = screen.put(column, row, meaning, Tone::kBar) + 1;
  }
  screen.fill(row, Tone::kBar);
}

}  // namespace

int table_rows(int height) {
  return std::max(0, height - kBodyRow - 1 - kFooterRows);
}

int text_rows(int height) {
  return std::max(0, height - kBodyRow - kFooterRows);
}

int text_lines(const Model& model, const View& view) {
  return static_cast<int>(lines_of(model, view).size());
}

Screen lay_out(const Model& model, const View& view, int width, int height) {
  Screen screen(width, height);
  put_header(screen, model, view);
  put_pages(screen, model, view);
  if (view.shows_help || view.shows_details) {
    put_lines(screen, model, view);
  } else {
    put_table(screen, model, view);
  }
  put_footer(screen, view);
  return screen;
}

std::string to_text(const Model& model, int width) {
  Screen header(width, kPagesRow);
  View view = first_view();
  put_header(header, model, view);
  std::string text = header.text();
  for (const Page page : pages_of(model)) {
    view.page = page;
    const Table table = table_of(model, view);
    const std::vector<Place> places = places_of(table, width);
    Screen body(width, static_cast<int>(table.lines.size()) + 2);
    put_headings(body, 1, table, places, view.order());
    for (std::size_t i = 0; i < table.lines.size(); ++i) {
      put_line(body, static_cast<int>(i) + 2, table, places, table.lines[i], false);
    }
    text += body.text();
  }
  return text;
}

}  // namespace fastcycle::tool::top
