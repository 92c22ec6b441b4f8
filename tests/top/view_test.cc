#include "top/view.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "test_model.h"
#include "top/layout.h"

namespace fastcycle::tool::top {
namespace {

using Kind = Key::Kind;
using testing::ElementsAre;
using testing::IsEmpty;

/// A person at a terminal of 80 × 24.
class Person {
 public:
  explicit Person(Model model) : model_(std::move(model)) {}

  Person& presses(Kind kind) {
    is_over_ = !press(view_, {kind, {}}, model_, 80, 24) || is_over_;
    return *this;
  }
  Person& types(const std::string& text) {
    for (const char character : text) {
      is_over_ =
          !press(view_, {Kind::kText, std::string(1, character)}, model_, 80, 24) || is_over_;
    }
    return *this;
  }

  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const Line& line : table_of(model_, view_).lines) {
      names.push_back(line.name);
    }
    return names;
  }
  [[nodiscard]] const View& view() const { return view_; }
  [[nodiscard]] bool is_over() const { return is_over_; }

 private:
  Model model_;
  View view_ = first_view();
  bool is_over_ = false;
};

TEST(AView, ShowsFirstWhatTakesMost) {
  Person person(drive());
  EXPECT_THAT(person.names(), ElementsAre("planner", "lidar_driver", "camera"));

  person.presses(Kind::kTab);
  EXPECT_THAT(person.names(), ElementsAre("lidar/points", "plan"));
}

TEST(AView, IsSortedByAnyColumn) {
  Person person(drive());

  person.types("<");
  EXPECT_THAT(person.names(), ElementsAre("lidar_driver", "planner", "camera")) << "by state";
  person.presses(Kind::kLeft);
  EXPECT_THAT(person.names(), ElementsAre("camera", "lidar_driver", "planner")) << "by name";
  person.presses(Kind::kLeft);
  EXPECT_THAT(person.names(), ElementsAre("camera", "lidar_driver", "planner"))
      << "by restarts, the last of the columns; what is equal in the model's order";
  person.types(">>.").presses(Kind::kRight);
  EXPECT_THAT(person.names(), ElementsAre("lidar_driver", "planner", "camera")) << "by activations";
}

TEST(AView, IsReversed) {
  Person person(drive());

  person.types("r");

  EXPECT_THAT(person.names(), ElementsAre("camera", "lidar_driver", "planner"));
}

TEST(AView, GoesRoundThePages) {
  Person person(drive());

  person.presses(Kind::kBackTab);
  EXPECT_EQ(person.view().page, Page::kTopics);
  person.presses(Kind::kTab);
  EXPECT_EQ(person.view().page, Page::kComponents);
  person.types("2");
  EXPECT_EQ(person.view().page, Page::kTopics);
}

TEST(AView, HasAPageOfChainsWhereThereAreSome) {
  Person person(drive_with_chains());

  person.types("3");
  EXPECT_EQ(person.view().page, Page::kChains);
  EXPECT_THAT(person.names(), ElementsAre("lidar_to_brake", "camera_to_plan")) << "by breaches";
  person.presses(Kind::kTab);
  EXPECT_EQ(person.view().page, Page::kComponents);

  Person other(drive());
  other.types("3");
  EXPECT_EQ(other.view().page, Page::kComponents);
}

TEST(AView, HasAPageOfProcessesWhereThereAreSeveral) {
  Person person(drive_in_processes());

  person.types("3");
  EXPECT_EQ(person.view().page, Page::kProcesses) << "there are no chains";
  EXPECT_THAT(person.names(), ElementsAre("sensing", "main")) << "by CPU";
  person.presses(Kind::kTab);
  EXPECT_EQ(person.view().page, Page::kComponents);
  person.presses(Kind::kBackTab);
  EXPECT_EQ(person.view().page, Page::kProcesses);

  Model model = drive_with_chains();
  model.processes = drive_in_processes().processes;
  Person other(model);
  other.types("4");
  EXPECT_EQ(other.view().page, Page::kProcesses);
}

TEST(AView, IsFilteredByWhatIsTyped) {
  Person person(drive());

  person.types("/Lid");
  EXPECT_THAT(person.names(), ElementsAre("lidar_driver"));
  person.presses(Kind::kBackspace).presses(Kind::kBackspace).presses(Kind::kBackspace).types("q");
  EXPECT_THAT(person.names(), IsEmpty()) << "while one types, q is a letter";
  EXPECT_FALSE(person.is_over());
  person.presses(Kind::kEscape);
  EXPECT_EQ(person.names().size(), 3U);
  person.types("q");
  EXPECT_TRUE(person.is_over());
}

TEST(AView, KeepsItsFilterAfterEnter) {
  Person person(drive());

  person.types("/sensors").presses(Kind::kEnter).types("r");
  EXPECT_THAT(person.names(), ElementsAre("camera", "lidar_driver"));

  person.presses(Kind::kEscape);
  EXPECT_EQ(person.names().size(), 3U);
}

TEST(AView, KeepsTheSelectedRowWhenTheOrderChanges) {
  Person person(drive());

  person.presses(Kind::kDown).presses(Kind::kDown);
  EXPECT_EQ(person.view().order().selected, "lidar_driver");
  person.types("r");
  EXPECT_EQ(person.view().order().selected, "lidar_driver");
  person.presses(Kind::kHome);
  EXPECT_EQ(person.view().order().selected, "camera");
  person.presses(Kind::kEnd).presses(Kind::kDown);
  EXPECT_EQ(person.view().order().selected, "planner");
}

TEST(AView, MovesByWholeScreens) {
  Person person(large(200));

  person.types("<<<").presses(Kind::kPageDown).presses(Kind::kPageDown);
  const std::string far = person.view().order().selected;
  person.presses(Kind::kPageUp).presses(Kind::kPageDown);

  EXPECT_EQ(person.view().order().selected, far);
  person.presses(Kind::kPageUp).presses(Kind::kPageUp).presses(Kind::kPageUp);
  EXPECT_EQ(person.view().order().selected, person.names().front());
}

TEST(AView, OfNothingHasNoSelection) {
  Person person(Model{});

  for (const Kind kind : {Kind::kDown, Kind::kEnd, Kind::kPageUp, Kind::kEnter, Kind::kLeft,
                          Kind::kTab, Kind::kEnter, Kind::kEscape}) {
    person.presses(kind);
  }

  EXPECT_EQ(person.view().order().selected, "");
  EXPECT_FALSE(person.view().shows_details);
}

TEST(AView, ScrollsTheHelpNoFurtherThanItGoes) {
  Person person(drive());

  person.types("?").presses(Kind::kEnd);
  const int last = person.view().scrolled;
  person.presses(Kind::kDown);

  EXPECT_GT(last, 0);
  EXPECT_EQ(person.view().scrolled, last);
  person.presses(Kind::kEscape);
  EXPECT_FALSE(person.view().shows_help);
}

TEST(AView, GoesBackOneByOne) {
  Person person(drive());

  person.types("/planner").presses(Kind::kEnter).presses(Kind::kEnter);
  EXPECT_TRUE(person.view().shows_details);
  EXPECT_EQ(person.view().order().selected, "planner");

  person.presses(Kind::kEscape);
  EXPECT_FALSE(person.view().shows_details);
  person.presses(Kind::kEscape);
  EXPECT_EQ(person.view().filter, "");
  person.presses(Kind::kEscape);
  EXPECT_EQ(person.view().order().selected, "");
  EXPECT_FALSE(person.is_over()) << "Escape never ends it";
}

}  // namespace
}  // namespace fastcycle::tool::top
