#include "trace/tracer.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "trace/test_trace.h"

namespace fastcycle::trace {
namespace {

using namespace std::chrono_literals;
using google::protobuf::Int64Value;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

/// Publishes three messages each Serve period.
class Source final : public Component {
 public:
  explicit Source(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override {
    for (int i = 0; i < 3; ++i) {
      numbers_.publish(numbers_.loan());
    }
  }

 private:
  Publisher<Int64Value> numbers_;
};

/// Answers each number.
class Middle final : public Component {
 public:
  explicit Middle(Context& context)
      : Component(context), answers_(context.create_publisher<Int64Value>("answers")) {
    context.create_subscriber<Int64Value>(
        "numbers", [this](const Int64Value&) { answers_.publish(answers_.loan()); });
  }

 private:
  Publisher<Int64Value> answers_;
};

/// Has a queue for one answer, and fails at the tenth.
class Sink final : public Component {
 public:
  explicit Sink(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("answers", {.depth = 1}, [this](const Int64Value&) {
      if (++count_ == 10) {
        throw std::runtime_error("ten");
      }
    });
  }

 private:
  int count_ = 0;
};

/// Takes requests, and never answers one.
class Silent final : public Component {
 public:
  explicit Silent(Context& context) : Component(context) {
    context.create_service<Int64Value, Int64Value>(
        "route", {.depth = 4}, [this](const Int64Value&, Responder<Int64Value> responder) {
          open_.push_back(std::move(responder));
        });
  }

 private:
  std::vector<Responder<Int64Value>> open_;
};

/// Has a timer of its own, and asks at each one's tick for what never comes.
class Asking final : public Component {
 public:
  explicit Asking(Context& context)
      : Component(context), client_(context.create_client<Int64Value, Int64Value>("route")) {
    context.create_timer({.period = 20ms}, [this] {
      client_.call(client_.loan(), {.deadline = 5ms}, [](const Reply<Int64Value>&) {});
    });
  }

  void serve() override {}

 private:
  Client<Int64Value, Int64Value> client_;
};

constexpr const char* kApplication = R"({"name": "traced", "on_fault": "restart",
  "restart": {"limit": 1000000, "within_s": 1},
  "executors": [{"name": "pool", "threads": 3}, {"name": "other", "threads": 1}],
  "components": [
    {"name": "source", "library": "source", "executor": "pool", "serve_period_ms": 1},
    {"name": "middle", "library": "middle", "executor": "pool"},
    {"name": "sink", "library": "sink", "executor": "other"}]})";

struct TracedRun {
  TestTrace trace;
  TraceReport report;
  std::string raw = {};
  std::uint64_t activations = 0;
  std::uint64_t overflows = 0;
};

TracedRun run_traced(const host::ClockOptions& clock, Duration length) {
  const config::TestFolder folder;
  Tracer tracer({.file = folder / "run.pftrace"});
  host::TestClasses classes;
  classes.with<Source>("source").with<Middle>("middle").with<Sink>("sink");
  config::Problems problems;
  host::Application application(host::describe_text(kApplication, problems), clock);
  application.add(tracer);
  application.build(classes, problems, host::ConstructorFault::kFault);
  if (problems.has_errors()) {
    throw std::runtime_error(config::text_of(problems));
  }
  application.start();
  application.run(length);
  application.stop();
  TracedRun run{.trace = read_trace(bytes_of(folder / "run.pftrace")),
                .report = tracer.report(),
                .raw = decode_raw(folder / "run.pftrace")};
  for (const auto& component : application.components()) {
    run.activations += component->statistics.activations.get();
  }
  run.overflows = host::ledger_of(application, "answers", "sink")
                      .dropped[static_cast<std::size_t>(detail::DropReason::kOverflow)];
  return run;
}

/// "planner: speed" is a slice of "planner".
std::string component_of(const TestSlice& slice) {
  return slice.name.substr(0, slice.name.find(": "));
}

/// The number of pairs of slices with the same `key` that are both under way at some time.
template <typename Key>
std::size_t overlaps_of(std::vector<TestSlice> slices, const Key& key) {
  std::ranges::sort(slices, {},
                    [](const TestSlice& slice) { return std::pair(slice.begin_ns, slice.end_ns); });
  std::map<std::string, std::int64_t> end_ns;
  std::size_t overlaps = 0;
  for (const TestSlice& slice : slices) {
    std::int64_t& end = end_ns[key(slice)];
    overlaps += slice.begin_ns < end ? 1 : 0;
    end = std::max(end, slice.end_ns);
  }
  return overlaps;
}

void expect_both_ends_of_flows(const TracedRun& run) {
  std::map<std::uint64_t, std::int64_t> begins;
  std::map<std::uint64_t, std::int64_t> ends;
  for (const TestEvent& event : run.trace.events) {
    if (event.flow_from != 0) {
      EXPECT_TRUE(begins.emplace(event.flow_from, event.time_ns).second);
      EXPECT_EQ(event.name.substr(0, 8), "publish ");
    }
    if (event.flow_to != 0) {
      EXPECT_TRUE(ends.emplace(event.flow_to, event.time_ns).second);
    }
  }
  EXPECT_EQ(begins.size(), run.report.flows);
  EXPECT_EQ(ends.size(), run.report.flows);
  for (const auto& [id, end_ns] : ends) {
    ASSERT_TRUE(begins.contains(id));
    EXPECT_LE(begins[id], end_ns);
  }
}

/// The publish lies in a slice of the component that owns the topic.
void expect_flows_to_begin_in_their_publisher(const TracedRun& run) {
  for (const TestEvent& event : run.trace.events) {
    if (event.flow_from == 0) {
      continue;
    }
    const std::string owner = event.name == "publish numbers" ? "source" : "middle";
    EXPECT_TRUE(std::ranges::any_of(run.trace.slices, [&](const TestSlice& slice) {
      return slice.track == event.track && component_of(slice) == owner &&
             slice.begin_ns <= event.time_ns && event.time_ns <= slice.end_ns;
    })) << event.name;
  }
}

TEST(ATrace, OfALiveRunHasEachActivationOnItsWorker) {
  const TracedRun run = run_traced({}, 200ms);

  EXPECT_EQ(run.report.slices, run.activations);
  EXPECT_EQ(run.trace.slices.size(), run.activations);
  EXPECT_EQ(run.report.activations_lost + run.report.events_lost + run.report.notes_lost, 0U);
  EXPECT_EQ(run.report.problem, "");
  std::set<std::string> tracks;
  std::set<std::string> names;
  for (const TestSlice& slice : run.trace.slices) {
    tracks.insert(run.trace.track_name(slice.track));
    names.insert(slice.name);
    if (component_of(slice) == "sink") {
      EXPECT_EQ(run.trace.track_name(slice.track), "other");
    }
  }
  for (const std::string& track : tracks) {
    EXPECT_THAT((std::set<std::string>{"pool-0", "pool-1", "pool-2", "other"}), Contains(track));
  }
  EXPECT_THAT(names, testing::IsSupersetOf(
                         {"source: serve", "middle: numbers", "sink: answers", "source: mode"}));
  EXPECT_TRUE(run.trace.clocks.contains(3));
  EXPECT_TRUE(run.trace.clocks.contains(1));
}

TEST(ATrace, OfALiveRunIsReadByProtoc) {
  const TracedRun run = run_traced({}, 50ms);

  // It cannot know what is text and what is a message, but sees each packet.
  std::size_t packets = 0;
  std::istringstream lines(run.raw);
  for (std::string line; std::getline(lines, line);) {
    packets += line == "1 {" ? 1 : 0;
  }
  EXPECT_EQ(packets, run.trace.packets);
  EXPECT_GT(packets, 2 * run.trace.slices.size());
}

TEST(ATrace, OfALiveRunHasNoTwoSlicesOfAComponentOrAWorkerAtOnce) {
  const TracedRun run = run_traced({}, 200ms);

  EXPECT_EQ(overlaps_of(run.trace.slices, component_of), 0U);
  EXPECT_EQ(overlaps_of(run.trace.slices,
                        [](const TestSlice& slice) { return std::to_string(slice.track); }),
            0U);
}

TEST(ATrace, OfALiveRunHasBothEndsOfEachFlow) {
  const TracedRun run = run_traced({}, 200ms);

  expect_both_ends_of_flows(run);
  expect_flows_to_begin_in_their_publisher(run);
  // One for each message that was delivered.
  const auto delivered = std::ranges::count_if(run.trace.slices, [](const TestSlice& slice) {
    return slice.name == "middle: numbers" || slice.name == "sink: answers";
  });
  EXPECT_GT(delivered, 0);
  EXPECT_EQ(run.report.flows, static_cast<std::uint64_t>(delivered));
}

TEST(ATrace, HasAnInstantForEachFaultAndEachDrop) {
  const TracedRun run = run_traced({.is_simulated = true, .workers = 1}, 100ms);

  std::uint64_t drops = 0;
  std::uint64_t faults = 0;
  for (const TestEvent& event : run.trace.events) {
    if (event.name == "fault of sink") {
      ++faults;
      EXPECT_THAT(event.what, HasSubstr("ten"));
    }
    if (event.name == "dropped: answers → sink" && event.what == "overflow") {
      ++drops;
    }
  }
  EXPECT_GT(faults, 0U);
  EXPECT_GT(drops, 0U);
  EXPECT_EQ(drops, run.overflows);
}

TEST(ATrace, HasACounterForEachQueue) {
  const TracedRun run = run_traced({.is_simulated = true, .workers = 1}, 20ms);

  std::map<std::string, std::vector<std::uint64_t>> depths;
  for (const TestEvent& event : run.trace.events) {
    if (event.type == 4) {
      depths[run.trace.track_name(event.track)].push_back(event.value);
    }
  }
  // After the round of a tick three wait; there is room for one of the answers.
  EXPECT_THAT(depths["queue numbers → middle"], Contains(3U));
  EXPECT_THAT(depths["queue answers → sink"], Contains(1U));
  EXPECT_THAT(depths["queue answers → sink"], testing::Each(testing::Le(1U)));
}

TEST(ATrace, OfSimulatedTimeShowsWhatFollowsAtOneMomentOneAfterTheOther) {
  const TracedRun run = run_traced({.is_simulated = true, .workers = 2}, 100ms);

  EXPECT_EQ(run.report.slices, run.activations);
  EXPECT_EQ(overlaps_of(run.trace.slices, component_of), 0U);
  expect_both_ends_of_flows(run);
  expect_flows_to_begin_in_their_publisher(run);
  for (const TestSlice& slice : run.trace.slices) {
    EXPECT_EQ(run.trace.track_name(slice.track), component_of(slice));
    EXPECT_GE(slice.begin_ns, slice.annotations.at("time_ns"));
  }
}

TEST(ATrace, NamesTimersByWhatTheyAreFor) {
  const config::TestFolder folder;
  Tracer tracer({.file = folder / "run.pftrace"});
  host::TestClasses classes;
  classes.with<Silent>("silent").with<Asking>("asking");
  config::Problems problems;
  host::Application application(host::describe_text(R"({"name": "traced", "components": [
      {"name": "silent", "library": "silent"},
      {"name": "asking", "library": "asking", "serve_period_ms": 10}]})",
                                                    problems),
                                {.is_simulated = true, .workers = 1});
  application.add(tracer);
  application.build(classes, problems, host::ConstructorFault::kFault);
  ASSERT_EQ(config::text_of(problems), "");

  application.start();
  application.run(50ms);
  application.stop();

  std::set<std::string> names;
  const TestTrace trace = read_trace(bytes_of(folder / "run.pftrace"));
  for (const TestSlice& slice : trace.slices) {
    names.insert(slice.name);
  }
  EXPECT_THAT(names, testing::IsSupersetOf({"asking: serve", "asking: timer 1",
                                            "asking: timeout of the reply of \"route\""}));
  EXPECT_THAT(names, testing::Not(Contains("asking: tick")));
}

TEST(ATrace, WithoutRoomCountsWhatIsLostAndCanStillBeRead) {
  const config::TestFolder folder;
  Tracer tracer({.file = folder / "run.pftrace", .buffer_bytes = 2000});
  host::TestClasses classes;
  classes.with<Source>("source").with<Middle>("middle").with<Sink>("sink");
  config::Problems problems;
  host::Application application(host::describe_text(kApplication, problems), {});
  application.add(tracer);
  application.build(classes, problems, host::ConstructorFault::kFault);
  ASSERT_FALSE(problems.has_errors());

  application.start();
  application.run(300ms);
  application.stop();

  TracedRun run{.trace = read_trace(bytes_of(folder / "run.pftrace")), .report = tracer.report()};
  EXPECT_GT(run.report.events_lost, 0U);
  EXPECT_TRUE(run.trace.says_that_packets_were_dropped);
  expect_both_ends_of_flows(run);
}

TEST(ATrace, ThatCannotBeWrittenKeepsTheApplicationFromStarting) {
  Tracer tracer({.file = "/nowhere/run.pftrace"});
  host::TestClasses classes;
  classes.with<Source>("source").with<Middle>("middle").with<Sink>("sink");
  config::Problems problems;
  host::Application application(host::describe_text(kApplication, problems), {});
  application.add(tracer);

  application.build(classes, problems, host::ConstructorFault::kFault);

  EXPECT_THAT(config::text_of(problems), HasSubstr("the trace cannot be written: /nowhere/"));
}

}  // namespace
}  // namespace fastcycle::trace
