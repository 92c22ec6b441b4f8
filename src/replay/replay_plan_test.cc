#include "replay/replay_plan.h"

#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "host/test_application.h"
#include "record/descriptor_set.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using record::RecordedStream;
using testing::HasSubstr;

const std::string kNumber = "google.protobuf.Int64Value";

RecordedStream stream(const std::string& topic, const std::string& publisher) {
  return {.topic = topic,
          .publisher = publisher,
          .encoding = "protobuf",
          .type = kNumber,
          .schema = record::descriptor_set_of(*Int64Value::descriptor())};
}

/// camera and radar publish, fusion joins them, control subscribes to fusion.
class Plans : public testing::Test {
 protected:
  ReplayPlan plan(const ReplayOptions& options) {
    problems_ = {};
    config::Problems ignored;
    const auto description = describe_text(text_, ignored);
    ReplayOptions with_file = options;
    with_file.files = {"drive.mcap"};
    return plan_replay(with_file, streams_, description, connections_, problems_);
  }

  [[nodiscard]] std::string said() const { return config::text_of(problems_); }

  std::string text_ = R"({"name": "t", "components": [
    {"name": "camera", "library": "c"}, {"name": "radar", "library": "r"},
    {"name": "fusion", "library": "f"}, {"name": "control", "library": "k"}]})";
  std::vector<Connection> connections_ = {
      {"camera", "image", kNumber, true},   {"radar", "tracks", kNumber, true},
      {"fusion", "image", kNumber, false},  {"fusion", "tracks", kNumber, false},
      {"fusion", "objects", kNumber, true}, {"control", "objects", kNumber, false}};
  std::vector<RecordedStream> streams_ = {stream("image", "camera"), stream("tracks", "radar"),
                                          stream("objects", "fusion")};
  config::Problems problems_;
};

TEST_F(Plans, WhoBringsWhatIsRecordedIsReplaced) {
  const ReplayPlan plan = this->plan({});

  EXPECT_EQ(plan.running, (std::set<std::string>{"control", "fusion"}));
  EXPECT_EQ(plan.streams[0].component, "camera");
  EXPECT_EQ(plan.streams[1].component, "radar");
  EXPECT_FALSE(plan.streams[2].is_fed());
  EXPECT_THAT(plan.streams[2].reason, HasSubstr("\"fusion\" publishes it, which runs"));
  EXPECT_TRUE(problems_.is_empty()) << said();
}

TEST_F(Plans, ADriverWhoseTopicsAreNotRecordedRuns) {
  streams_ = {stream("image", "camera")};

  EXPECT_EQ(plan({}).running, (std::set<std::string>{"control", "fusion", "radar"}));
}

TEST_F(Plans, OnlyWhoIsNamedRuns) {
  const ReplayPlan plan = this->plan({.into = {"control"}});

  EXPECT_EQ(plan.running, (std::set<std::string>{"control"}));
  EXPECT_FALSE(plan.streams[0].is_fed());
  EXPECT_EQ(plan.streams[2].component, "fusion");
  EXPECT_FALSE(plan.stands_in_for("camera"));
}

TEST_F(Plans, AnUnknownComponentIsAnErrorWithTheNearestName) {
  static_cast<void>(plan({.into = {"fussion"}}));

  EXPECT_THAT(said(), HasSubstr("there is no component \"fussion\"; did you mean \"fusion\"?"));
}

TEST_F(Plans, AnInputFromNowhereIsAWarningThatNamesAllThree) {
  streams_ = {stream("image", "camera")};
  static_cast<void>(plan({.into = {"fusion"}}));

  EXPECT_FALSE(problems_.has_errors());
  EXPECT_THAT(said(), HasSubstr("topic \"tracks\", which component \"fusion\" subscribes to, is "
                                "not in the recording, and component \"radar\", which publishes "
                                "it, does not run"));
}

TEST_F(Plans, WhatIsExceptedIsNotFedAndWhatIsNamedIsAlsoWithoutASubscriber) {
  const ReplayPlan without = plan({.filter = {.topics = {}, .except = {"image"}}});
  EXPECT_FALSE(without.streams[0].is_fed());
  EXPECT_TRUE(without.runs("camera"));

  const ReplayPlan named =
      plan({.into = {"control"}, .filter = {.topics = {"image", "objects"}, .except = {}}});
  EXPECT_TRUE(named.streams[0].is_fed());
  EXPECT_FALSE(named.streams[1].is_fed());
  EXPECT_TRUE(named.streams[2].is_fed());
}

TEST_F(Plans, NothingToFeedIsAnError) {
  streams_ = {stream("lidar", "lidar")};
  static_cast<void>(plan({}));

  EXPECT_THAT(said(), HasSubstr("there is nothing to feed: the recording has the topics lidar; the "
                                "components that run subscribe to image, objects, tracks"));
}

TEST_F(Plans, ARecordingOfNothingIsAnError) {
  streams_.clear();
  static_cast<void>(plan({}));

  EXPECT_THAT(said(), HasSubstr("the recording has no messages"));
}

TEST_F(Plans, AnotherTypeThanTheSubscribersIsAnError) {
  streams_[0].type = "demo.Image";
  static_cast<void>(plan({}));

  EXPECT_THAT(said(), HasSubstr("topic \"image\" has the type demo.Image in the recording, but "
                                "component \"fusion\" uses it as " +
                                kNumber));
}

TEST_F(Plans, AChangedTypeIsAWarning) {
  google::protobuf::FileDescriptorSet set;
  ASSERT_TRUE(set.ParseFromString(streams_[0].schema));
  for (auto& message : *set.mutable_file(0)->mutable_message_type()) {
    if (message.name() == "Int64Value") {
      message.mutable_field(0)->set_type(google::protobuf::FieldDescriptorProto::TYPE_DOUBLE);
    }
  }
  streams_[0].schema = set.SerializeAsString();
  const ReplayPlan plan = this->plan({});

  EXPECT_TRUE(plan.streams[0].is_fed());
  EXPECT_FALSE(problems_.has_errors());
  EXPECT_THAT(said(), HasSubstr("topic \"image\": field google.protobuf.Int64Value.value = 1 is "
                                "int64, and was double when it was recorded"));
}

TEST_F(Plans, WhatIsNotProtobufIsNotFed) {
  streams_[0].encoding = "json";
  const ReplayPlan plan = this->plan({});

  EXPECT_FALSE(plan.streams[0].is_fed());
  EXPECT_THAT(plan.streams[0].reason, HasSubstr("not protobuf, but \"json\""));
}

TEST_F(Plans, AMalformedRemapIsAnError) {
  static_cast<void>(plan({.remap = {{"imag", "image"}}}));

  EXPECT_THAT(said(), HasSubstr("no topic \"imag\"; did you mean \"image\"?"));
}

TEST_F(Plans, APublisherThatIsNoComponentStandsAtTheEnd) {
  streams_[0].publisher = "front_camera";
  streams_[1].publisher = "";
  const ReplayPlan plan = this->plan({.into = {"fusion"}});
  config::Problems ignored;
  const auto description = describe_replay(describe_text(text_, ignored), plan);

  EXPECT_EQ(plan.streams[0].component, "front_camera");
  EXPECT_EQ(plan.streams[1].component, "radar");
  ASSERT_EQ(description.components.size(), 5U);
  EXPECT_EQ(description.components[0].library, "");
  EXPECT_EQ(description.components[2].library, "f");
  EXPECT_EQ(description.components[4].name, "front_camera");
}

TEST_F(Plans, WhatToolsPublishedIsFedBesideTheComponentThatPublishes) {
  streams_.push_back(stream("image", "fastcycle/inspect"));
  streams_.push_back(stream("objects", "fastcycle/inspect"));
  const ReplayPlan plan = this->plan({});
  config::Problems ignored;
  const auto description = describe_replay(describe_text(text_, ignored), plan);

  EXPECT_EQ(plan.streams[3].component, "fastcycle/inspect") << plan.streams[3].reason;
  EXPECT_EQ(plan.streams[4].component, "fastcycle/inspect") << plan.streams[4].reason;
  EXPECT_EQ(plan.shared_topics, (std::set<std::string>{"image", "objects"}));
  ASSERT_EQ(description.topics.size(), 2U);
  EXPECT_TRUE(description.topics[0].multiple_publishers);
  EXPECT_TRUE(problems_.is_empty()) << said();
}

TEST_F(Plans, ADriverIsNotReplacedByWhatAToolPublished) {
  streams_ = {stream("image", "fastcycle/inspect"), stream("tracks", "radar")};
  const ReplayPlan plan = this->plan({});

  EXPECT_EQ(plan.running, (std::set<std::string>{"camera", "control", "fusion"}));
  EXPECT_TRUE(plan.streams[0].is_fed());
}

TEST_F(Plans, WhatTheFileSaysOfASharedTopicStays) {
  text_.insert(1, R"("topics": {"image": {"latched": 3}},)");
  streams_.push_back(stream("image", "fastcycle/inspect"));
  config::Problems ignored;
  const auto description = describe_replay(describe_text(text_, ignored), plan({}));

  ASSERT_EQ(description.topics.size(), 1U);
  EXPECT_EQ(description.topics[0].latched, 3);
  EXPECT_TRUE(description.topics[0].multiple_publishers);
}

}  // namespace
}  // namespace fastcycle::host
