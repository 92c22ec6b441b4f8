#include "top/layout.h"

#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "test_model.h"
#include "top/text.h"

namespace fastcycle::tool::top {
namespace {

using testing::HasSubstr;
using testing::Not;

View view_of(Page page) {
  View view = first_view();
  view.page = page;
  return view;
}

std::string text_of(const Model& model, const View& view, int width, int height) {
  return lay_out(model, view, width, height).text();
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
  }
  return lines;
}

TEST(Layout, OfComponentsAt80Columns) {
  EXPECT_EQ(text_of(drive(), view_of(Page::kComponents), 80, 10),
            R"(drive  mode highway  up 0:01:23  pid 4711
CPU 34.5 %  RSS 45.1MB  dropped 12  faults 1  2345 msg/s  of 2 CPUs  over 1.0 s
 1 Components 3  2 Topics 2
COMPONENT      STATE      CPU%▼  ACT/s    P50    P99    MAX  LATE99  FAULT  RST
planner        degraded    61.0   20.0 25.0ms 31.0ms 48.0ms       -      0    0
lidar_driver   active      12.5    100  120µs 1.25ms 4.00ms  50.0µs      0    0
camera         failed       0.0      0      -      -      -       -      1    1


 q quit  ? help  Tab page  <> sort  r flip  / filter  Space pause  Enter more
)");
}

TEST(Layout, OfTopicsAt80Columns) {
  EXPECT_EQ(text_of(drive(), view_of(Page::kTopics), 80, 10),
            R"(drive  mode highway  up 0:01:23  pid 4711
CPU 34.5 %  RSS 45.1MB  dropped 12  faults 1  2345 msg/s  of 2 CPUs  over 1.0 s
 1 Components 3  2 Topics 2
TOPIC               RATE▼  BYTES/s    P50    P99     QUEUE   LOST REASONS
lidar/points          100    400MB 21.0µs 74.0µs       3/4     12 overflow 11, …
plan                 20.0        -      -      -         -      0



 q quit  ? help  Tab page  <> sort  r flip  / filter  Space pause  Enter more
)");
}

TEST(Layout, OfChainsAt80Columns) {
  EXPECT_EQ(text_of(drive_with_chains(), view_of(Page::kChains), 80, 10),
            R"(drive  mode highway  up 0:01:23  pid 4711
CPU 34.5 %  RSS 45.1MB  dropped 12  faults 1  2345 msg/s  of 2 CPUs  over 1.0 s
 1 Components 3  2 Topics 2  3 Chains 2
CHAIN           DEADLN    P50    P99    MAX  COUNT BREACH▼ CONTRIBUTOR
lidar_to_brake   100ms 48.0ms 97.0ms  131ms   1660       7 planner running
camera_to_plan   200ms 80.0ms  120ms  150ms    800       0



 q quit  ? help  Tab page  <> sort  r flip  / filter  Space pause  Enter more
)");
}

TEST(Layout, OfAChainsDetailsHasItsHopsAndTheLargestContributor) {
  View view = view_of(Page::kChains);
  view.order().selected = "lidar_to_brake";
  view.shows_details = true;

  const std::string text = text_of(drive_with_chains(), view, 80, 24);

  EXPECT_THAT(text, HasSubstr("planner, publishes plan"));
  EXPECT_THAT(text, HasSubstr("largest contributor to 7"));
  EXPECT_THAT(text, HasSubstr("7 of 1660, 7 dropped"));
}

TEST(Layout, HasMoreColumnsWhereThereIsMoreRoom) {
  const std::string text = text_of(drive(), view_of(Page::kComponents), 140, 40);

  for (const char* column : {"EXECUTOR", "P50", "QUEUED", "OVERR", "REMARK", "LATEMX"}) {
    EXPECT_THAT(text, HasSubstr(column));
  }
  EXPECT_THAT(text, HasSubstr("the map is old"));
  EXPECT_THAT(text_of(drive(), view_of(Page::kTopics), 120, 40), HasSubstr("lidar.Points"));
}

TEST(Layout, AtFortyColumnsHasWhatMattersMost) {
  const std::string text = text_of(drive(), view_of(Page::kComponents), 40, 10);

  EXPECT_THAT(text, HasSubstr("drive"));
  EXPECT_THAT(text, HasSubstr("planner"));
  EXPECT_THAT(text, HasSubstr("CPU%"));
  EXPECT_THAT(text, HasSubstr("61.0"));
  EXPECT_THAT(text, Not(HasSubstr("LATE99")));
  EXPECT_EQ(lines_of(text).size(), 10U);
}

TEST(Layout, ShowsEachProcessWithItsThreadsAndComponents) {
  const Model model = drive_in_processes();
  View view = view_of(Page::kProcesses);
  const std::string table = text_of(model, view, 100, 20);
  EXPECT_THAT(table, HasSubstr("3 Processes 2"));
  EXPECT_THAT(table, HasSubstr("planner, camera"));
  EXPECT_THAT(table, HasSubstr("2 processes"));

  view.order().selected = "sensing";
  view.shows_details = true;
  const std::string details = text_of(model, view, 100, 20);
  EXPECT_THAT(details, HasSubstr("4712"));
  EXPECT_THAT(details, HasSubstr("sensors-0   CPU 60.0 %"));
  EXPECT_THAT(details, HasSubstr("fastcycle (2)   CPU - %"));

  view = view_of(Page::kComponents);
  view.order().selected = "lidar_driver";
  view.shows_details = true;
  EXPECT_THAT(text_of(model, view, 100, 30), HasSubstr("tick scan   p50 1.00ms"));
}

TEST(Layout, FitsAnyScreen) {
  Model model = drive_in_processes();
  model.components[0].name = "sensors/front/激光雷达/driver_with_a_name_that_never_ends_for_long";
  model.topics[0].name = std::string(300, 'x');
  model.application = std::string(100, 'y');
  for (const Page page : {Page::kComponents, Page::kTopics, Page::kChains, Page::kProcesses}) {
    for (const bool has_text : {false, true}) {
      View view = view_of(page);
      view.shows_help = has_text;
      for (const auto& [width, height] : std::vector<std::pair<int, int>>{
               {1, 1}, {2, 3}, {5, 4}, {10, 5}, {40, 10}, {80, 24}, {120, 40}, {400, 100}}) {
        const Screen screen = lay_out(model, view, width, height);
        EXPECT_EQ(screen.width(), width);
        EXPECT_EQ(screen.height(), height);
        for (const std::string& line : lines_of(screen.text())) {
          EXPECT_LE(width_of(line), width) << line;
        }
      }
    }
  }
}

TEST(Layout, ShortensLongNamesInTheMiddle) {
  Model model = drive();
  model.topics[0].name = "sensors/front/left/lidar/points_without_ground/clustered";

  EXPECT_THAT(text_of(model, view_of(Page::kTopics), 80, 24), HasSubstr("clustered"));
  EXPECT_THAT(text_of(model, view_of(Page::kTopics), 80, 24), HasSubstr("…"));
  EXPECT_THAT(text_of(model, view_of(Page::kTopics), 160, 24), HasSubstr(model.topics[0].name));
}

TEST(Layout, KeepsColumnsInLineUnderWideNames) {
  Model model = drive();
  model.components[0].name = "激光雷达";
  model.components[1].name = "größe";

  const std::vector<std::string> lines =
      lines_of(text_of(model, view_of(Page::kComponents), 80, 24));

  std::vector<int> columns;
  for (const std::string& line : lines) {
    for (const char* state : {"degraded", "active ", "failed "}) {
      if (const std::size_t place = line.find(state); place != std::string::npos) {
        columns.push_back(width_of(line.substr(0, place)));
      }
    }
  }
  ASSERT_EQ(columns.size(), 3U);
  EXPECT_EQ(columns[0], columns[1]);
  EXPECT_EQ(columns[1], columns[2]);
}

TEST(Layout, SaysThatThereIsNothing) {
  View view = view_of(Page::kComponents);
  EXPECT_THAT(text_of(Model{}, view, 80, 24), HasSubstr("no components"));
  view.page = Page::kTopics;
  EXPECT_THAT(text_of(Model{}, view, 80, 24), HasSubstr("no topics"));
  view.filter = "lidar";
  EXPECT_THAT(text_of(Model{}, view, 80, 24), HasSubstr("nothing matches the filter"));
}

TEST(Layout, OfManyShowsWhereOneIs) {
  const Model model = large(200);
  View view = view_of(Page::kComponents);
  view.order().column = 0;
  std::string text = text_of(model, view, 80, 24);
  EXPECT_THAT(text, HasSubstr("1-19 of 200"));
  EXPECT_THAT(text, HasSubstr("component_018"));
  EXPECT_THAT(text, Not(HasSubstr("component_019")));

  view.order().selected = "component_100";
  text = text_of(model, view, 80, 24);
  EXPECT_THAT(text, HasSubstr("92-110 of 200"));
  EXPECT_THAT(text, HasSubstr("component_100"));

  view.order().selected = "component_199";
  text = text_of(model, view, 80, 24);
  EXPECT_THAT(text, HasSubstr("182-200 of 200"));
}

TEST(Layout, ShowsTheSelectedRowAsSuch) {
  View view = view_of(Page::kComponents);
  view.order().selected = "camera";

  const Screen screen = lay_out(drive(), view, 80, 24);

  int selected = 0;
  for (int row = 0; row < screen.height(); ++row) {
    if (screen.at(40, row).tone == Tone::kSelected) {
      EXPECT_THAT(screen.row_text(row), HasSubstr("camera"));
      ++selected;
    }
  }
  EXPECT_EQ(selected, 1);
}

TEST(Layout, MarksTheColumnThatOrders) {
  View view = view_of(Page::kComponents);
  EXPECT_THAT(text_of(drive(), view, 80, 24), HasSubstr("CPU%▼"));
  view.order().is_reversed = true;
  EXPECT_THAT(text_of(drive(), view, 80, 24), HasSubstr("CPU%▲"));
  view.order() = {};
  EXPECT_THAT(text_of(drive(), view, 80, 24), HasSubstr("COMPONENT▲"));
}

TEST(Layout, ShowsPauseFilterAndSilence) {
  View view = view_of(Page::kComponents);
  view.is_paused = true;
  view.filter = "cam";
  view.is_typing_filter = true;
  std::string text = text_of(drive(), view, 80, 24);
  EXPECT_THAT(text, HasSubstr("PAUSED"));
  EXPECT_THAT(text, HasSubstr("filter: cam_"));
  EXPECT_THAT(text, HasSubstr("Enter keep"));

  view.notice = "no answer for 4 s";
  text = text_of(drive(), view, 80, 24);
  EXPECT_THAT(text, HasSubstr("no answer for 4 s"));
}

TEST(Layout, ShowsWhyARunEnds) {
  Model model = drive();
  model.end = "all sources are over";

  EXPECT_THAT(text_of(model, view_of(Page::kComponents), 80, 24),
              HasSubstr("ends: all sources are over"));
}

TEST(Layout, OfATopicsDetailsHasEveryLossWithItsReason) {
  View view = view_of(Page::kTopics);
  view.order().selected = "lidar/points";
  view.shows_details = true;

  const std::string text = text_of(drive(), view, 80, 24);

  EXPECT_THAT(text, HasSubstr("planner (callback)"));
  EXPECT_THAT(text, HasSubstr("11 by overflow"));
  EXPECT_THAT(text, HasSubstr("1 by fault"));
  EXPECT_THAT(text, HasSubstr("400MB/s"));
}

TEST(Layout, OfAComponentsDetailsHasItsTopics) {
  View view = view_of(Page::kComponents);
  view.order().selected = "planner";
  view.shows_details = true;

  const std::string text = text_of(drive(), view, 100, 24);

  EXPECT_THAT(text, HasSubstr("the map is old"));
  EXPECT_THAT(text, HasSubstr("plan   20.0 a second"));
  EXPECT_THAT(text, HasSubstr("lidar/points   queue 3/4   lost 12"));
}

TEST(Layout, OfDetailsOfWhatIsGoneSaysSo) {
  View view = view_of(Page::kComponents);
  view.order().selected = "gone";
  view.shows_details = true;

  EXPECT_THAT(text_of(drive(), view, 80, 24), HasSubstr("gone no longer exists"));
}

TEST(Layout, OfTheHelpExplainsAllColumnsOfItsPage) {
  View view = view_of(Page::kTopics);
  view.shows_help = true;

  const std::string text = text_of(drive(), view, 80, 40);

  for (const Heading& heading : topic_table(Model{}).headings) {
    EXPECT_THAT(text, HasSubstr(heading.meaning));
  }
}

TEST(Layout, ForAPipeHasAllRowsOfAllPages) {
  const std::string text = to_text(large(200), 100);

  EXPECT_THAT(text, HasSubstr("component_000"));
  EXPECT_THAT(text, HasSubstr("component_199"));
  EXPECT_THAT(text, HasSubstr("topic_199"));
  EXPECT_THAT(text, Not(HasSubstr("\x1b")));
}

}  // namespace
}  // namespace fastcycle::tool::top
