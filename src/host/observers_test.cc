#include "host/observers.h"

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "host/application.h"

namespace fastcycle::host {
namespace {

using ::testing::ElementsAre;

/// Writes down what it receives.
class RecordingObserver final : public Observer {
 public:
  RecordingObserver(std::vector<std::string>& lines, std::string name, bool wants_changes)
      : lines_(lines), name_(std::move(name)), wants_changes_(wants_changes) {}

  void tap(detail::Topics&) override { note("tap"); }
  void open(config::Problems&) override { note("open"); }
  void start(const ObserverView&, std::vector<base::Refusal>&) override { note("start"); }
  void faulted(std::string_view component, std::string_view) noexcept override {
    note("fault of " + std::string(component));
  }
  void changed(const ComponentNews&) noexcept override { note("change"); }
  [[nodiscard]] bool wants_changes() const override { return wants_changes_; }
  void stop(const Application&) override { note("stop"); }

 private:
  void note(const std::string& what) { lines_.push_back(name_ + " " + what); }

  std::vector<std::string>& lines_;
  std::string name_;
  bool wants_changes_;
};

TEST(Observers, AreNotifiedInTheirOrderUntilTheEnd) {
  const Application application({}, {.is_simulated = true, .workers = 1});
  std::vector<std::string> lines;
  Observers observers;
  RecordingObserver first(lines, "first", false);
  observers.add(first);
  observers.add(std::make_unique<RecordingObserver>(lines, "second", true));
  config::Problems problems;
  std::vector<base::Refusal> refusals;
  detail::Topics topics;
  observers.tap(topics);
  observers.open(problems);
  observers.faulted("it", "threw");
  EXPECT_TRUE(observers.wants_changes());
  observers.changed({});
  observers.stop(application);
  observers.faulted("it", "threw again");
  observers.changed({});
  EXPECT_THAT(lines, ElementsAre("first tap", "second tap", "first open", "second open",
                                 "first fault of it", "second fault of it", "second change",
                                 "first stop", "second stop"));
}

}  // namespace
}  // namespace fastcycle::host
