#include "dds_gateway/param_services.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "basic/basic.pb.h"
#include "dds_gateway/gateway.h"
#include "dds_gateway/test_network.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A component with a parameter of each kind.
class Limiter final : public Component {
 public:
  enum class Mode : std::uint8_t { kEco, kSport };

  explicit Limiter(Context& context)
      : Component(context),
        limit_mps_(context.param<double>("limit_mps", {.fallback = 13.9,
                                                       .min = 0.0,
                                                       .max = 60.0,
                                                       .unit = "m/s",
                                                       .description = "Nothing faster passes",
                                                       .is_tunable = true})),
        gears_(context.param<std::vector<std::int64_t>>(
            "gears", {.fallback = std::vector<std::int64_t>{1, 2}, .is_tunable = true})),
        mode_(context.param<Mode>("mode", {.fallback = Mode::kEco,
                                           .names = {{"eco", Mode::kEco}, {"sport", Mode::kSport}},
                                           .is_tunable = true})),
        label_(
            context.param<basic::Text>("label", {.fallback = basic::Text(), .is_tunable = true})),
        fixed_(context.param<bool>("is_fixed", {.fallback = true})),
        hidden_(context.param<double>("secret", {.fallback = 1.0, .is_tunable = true})) {
    context.check_params([this](const ProposedParams& proposed) {
      return proposed.get(limit_mps_) > 30.0 && proposed.get(mode_) == Mode::kEco
                 ? "no more than 30 m/s in the mode eco"
                 : "";
    });
  }

 private:
  Param<double> limit_mps_;
  Param<std::vector<std::int64_t>> gears_;
  Param<Mode> mode_;
  Param<basic::Text> label_;
  Param<bool> fixed_;
  Param<double> hidden_;
};

/// A request or a reply while it is written or read.
class Message {
 public:
  Message() : writer_(bytes_) {}
  Message& names(const std::vector<std::string>& names) {
    writer_.count(names.size());
    for (const std::string& name : names) {
      writer_.text(name);
    }
    return *this;
  }
  Message& params(const std::vector<RosParam>& params) {
    writer_.count(params.size());
    for (const RosParam& param : params) {
      writer_.text(param.name);
      write(param.value, writer_);
    }
    return *this;
  }
  Message& number(std::uint64_t number) {
    writer_.number(number);
    return *this;
  }
  ros2::Buffer& end() {
    writer_.end();
    return bytes_;
  }

 private:
  ros2::Buffer bytes_;
  ros2::CdrWriter writer_;
};

/// An application with a gateway, and a participant beside it that asks as a tool of ROS 2 does.
class ParamServicesTest : public ::testing::TestWithParam<const char*> {
 protected:
  ParamServicesTest() {
    bench_.add<Limiter>("limiter");
    bench_.add<Gateway>(
        "gateway", fmt::format(R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo",
            "node": "/car/gate", "parameters": [
              {{"param": "limiter.limit_mps", "access": "change"}},
              {{"param": "limiter.gears", "access": "change"}},
              {{"param": "limiter.mode", "access": "change"}},
              {{"param": "limiter.label", "access": "change"}},
              {{"param": "limiter.is_fixed", "access": "change"}},
              {{"param": "gateway.domain"}}]}}}})",
                               GetParam(), domain_of_test()));
  }

  /// Asks until it is answered; the reply is valid until the next question.
  ros2::CdrReader ask(const std::string& service, const std::string& type,
                      const std::function<ros2::Buffer&(Message&)>& fill) {
    const auto all = engines();
    const auto engine = std::ranges::find_if(
        all, [](const Engine& one) { return std::string_view(one.name) == GetParam(); });
    const auto participant = engine->create(
        {.domain = domain_of_test(), .interface = "lo", .user_data = "", .security = ""});
    const std::string name = "/car/gate/" + service;
    const std::string id = participant->service_user_data(true);
    const auto endpoint = [&](bool is_reply) {
      return Endpoint{
          .topic = is_reply ? ros2::dds_reply_topic(name) : ros2::dds_request_topic(name),
          .type = ros2::dds_type(type + (is_reply ? "_Response" : "_Request")),
          .user_data = id,
          .qos = {},
          .is_reader = is_reply,
          .role = is_reply ? Role::kReplies : Role::kRequests};
    };
    reply_.clear();
    const auto reader = participant->create_reader(
        endpoint(true), [&](std::span<const std::byte> message, const SampleInfo&) {
          reply_.assign(message.begin(), message.end());
        });
    const auto writer = participant->create_writer(endpoint(false));
    const auto end = std::chrono::steady_clock::now() + 60s;
    for (int turn = 0; reply_.empty(); ++turn) {
      if (std::chrono::steady_clock::now() > end) {
        ADD_FAILURE() << service << " was not answered";
        reply_.resize(64);
        break;
      }
      // The first reply may go before the server has found its reader.
      if (writer->matched() > 0 && reader->matched() > 0 && turn % 200 == 0) {
        Message message;
        (void)writer->write_request(fill(message), reader->guid());
      }
      participant->serve(1ms);
      bench_.advance(1ms);
      turn = writer->matched() > 0 && reader->matched() > 0 ? turn : -1;
    }
    return ros2::CdrReader(reply_);
  }
  std::vector<std::string> set(const std::vector<RosParam>& params) {
    ros2::CdrReader in =
        ask("set_parameters", "rcl_interfaces/srv/SetParameters",
            [&](Message& message) -> ros2::Buffer& { return message.params(params).end(); });
    std::vector<std::string> results;
    for (std::uint32_t left = in.count("results", 5); left > 0; --left) {
      results.emplace_back(in.boolean("successful") ? "done " : "not done ");
      results.back() += in.text("reason");
    }
    return results;
  }
  RosParamValue get(const std::string& name) {
    ros2::CdrReader in =
        ask("get_parameters", "rcl_interfaces/srv/GetParameters",
            [&](Message& message) -> ros2::Buffer& { return message.names({name}).end(); });
    EXPECT_EQ(in.count("values", 1), 1U);
    return read_param_value(in);
  }

  testing::Bench bench_;
  std::vector<std::byte> reply_;
};

TEST_P(ParamServicesTest, ListsWhatIsShownAndNothingElse) {
  bench_.start();

  ros2::CdrReader in =
      ask("list_parameters", "rcl_interfaces/srv/ListParameters",
          [](Message& message) -> ros2::Buffer& { return message.names({}).number(0).end(); });

  std::vector<std::string> names;
  for (std::uint32_t left = in.count("names", 5); left > 0; --left) {
    names.push_back(in.text("name"));
  }
  EXPECT_THAT(names, ElementsAre("gateway.domain", "limiter.gears", "limiter.is_fixed",
                                 "limiter.label", "limiter.limit_mps", "limiter.mode"));
}

TEST_P(ParamServicesTest, GivesValuesAndHidesTheOthers) {
  bench_.start();

  EXPECT_EQ(get("limiter.limit_mps"), RosParamValue(13.9));
  EXPECT_EQ(get("limiter.gears"), RosParamValue(std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(get("limiter.mode"), RosParamValue(std::string("eco")));
  EXPECT_EQ(get("limiter.is_fixed"), RosParamValue(true));
  EXPECT_EQ(get("limiter.secret"), RosParamValue());
}

TEST_P(ParamServicesTest, DescribesTypeRangeAndWhetherItMayBeChanged) {
  bench_.start();

  ros2::CdrReader in =
      ask("describe_parameters", "rcl_interfaces/srv/DescribeParameters",
          [](Message& message) -> ros2::Buffer& {
            return message.names({"limiter.limit_mps", "limiter.mode", "gateway.domain"}).end();
          });

  ASSERT_EQ(in.count("descriptors", 20), 3U);
  EXPECT_EQ(in.text("name"), "limiter.limit_mps");
  EXPECT_EQ(in.number<std::uint8_t>("type"), 3);
  EXPECT_EQ(in.text("description"), "Nothing faster passes [m/s]");
  EXPECT_EQ(in.text("additional_constraints"), "");
  EXPECT_FALSE(in.boolean("read_only"));
  EXPECT_FALSE(in.boolean("dynamic_typing"));
  EXPECT_EQ(in.count("floating_point_range", 24), 1U);
  EXPECT_EQ(in.number<double>("from_value"), 0.0);
  EXPECT_EQ(in.number<double>("to_value"), 60.0);
  EXPECT_EQ(in.number<double>("step"), 0.0);
  EXPECT_EQ(in.count("integer_range", 24), 0U);
  EXPECT_EQ(in.text("name"), "limiter.mode");
  EXPECT_EQ(in.number<std::uint8_t>("type"), 4);
  EXPECT_EQ(in.text("description"), "");
  EXPECT_EQ(in.text("additional_constraints"), "one of eco, sport");
  EXPECT_FALSE(in.boolean("read_only"));
  (void)in.boolean("dynamic_typing");
  EXPECT_EQ(in.count("floating_point_range", 24) + in.count("integer_range", 24), 0U);
  EXPECT_EQ(in.text("name"), "gateway.domain");
  EXPECT_EQ(in.number<std::uint8_t>("type"), 2);
  (void)in.text("description");
  (void)in.text("additional_constraints");
  EXPECT_TRUE(in.boolean("read_only"));
}

TEST_P(ParamServicesTest, ChangesOneByOneAndGivesTheReasonsOfWhatIsRefused) {
  bench_.start();

  const auto results = set({{"limiter.limit_mps", 25.0},
                            {"limiter.limit_mps", 70.0},
                            {"limiter.mode", std::string("fast")},
                            {"limiter.is_fixed", false},
                            {"limiter.secret", 2.0},
                            {"gateway.domain", std::int64_t{1}},
                            {"limiter.label", std::string(R"({"data": "x"})")},
                            {"limiter.gears", std::vector<std::int64_t>{3}}});

  ASSERT_EQ(results.size(), 8U);
  EXPECT_EQ(results[0], "done ");
  EXPECT_THAT(results[1], HasSubstr("not done limiter.limit_mps: expected a number in [0, 60]"));
  EXPECT_THAT(results[2], HasSubstr("not done limiter.mode: expected"));
  EXPECT_THAT(results[3], HasSubstr("limiter.is_fixed: it is not tunable"));
  EXPECT_THAT(results[4], HasSubstr("limiter.secret: there is no such parameter"));
  EXPECT_THAT(results[5], HasSubstr("not tunable"));
  EXPECT_EQ(results[6], "done ");
  EXPECT_EQ(results[7], "done ");
  EXPECT_EQ(get("limiter.limit_mps"), RosParamValue(25.0));
  EXPECT_EQ(get("limiter.gears"), RosParamValue(std::vector<std::int64_t>{3}));
}

TEST_P(ParamServicesTest, ChangesAllOrNoneAtomically) {
  bench_.start();
  const auto set_both = [&](const std::string& mode) {
    ros2::CdrReader in =
        ask("set_parameters_atomically", "rcl_interfaces/srv/SetParametersAtomically",
            [&](Message& message) -> ros2::Buffer& {
              return message.params({{"limiter.limit_mps", 40.0}, {"limiter.mode", mode}}).end();
            });
    const bool is_done = in.boolean("successful");
    return (is_done ? "done " : "not done ") + in.text("reason");
  };

  EXPECT_THAT(set_both("eco"),
              AllOf(HasSubstr("not done "), HasSubstr("no more than 30 m/s in the mode eco")));
  EXPECT_EQ(get("limiter.limit_mps"), RosParamValue(13.9));
  EXPECT_EQ(set_both("sport"), "done ");
  EXPECT_EQ(get("limiter.limit_mps"), RosParamValue(40.0));
  EXPECT_EQ(get("limiter.mode"), RosParamValue(std::string("sport")));
}

TEST_P(ParamServicesTest, CountsRequestsThatAreNoneAndGoesOn) {
  bench_.start();
  int sent = 0;

  ros2::CdrReader in = ask("get_parameter_types", "rcl_interfaces/srv/GetParameterTypes",
                           [&](Message& message) -> ros2::Buffer& {
                             return ++sent <= 3
                                        ? message.number(0x7fff'ffff).end()
                                        : message.names({"limiter.mode", "limiter.none"}).end();
                           });
  const auto types = in.bytes("types");

  EXPECT_THAT(types, ElementsAre(std::byte{4}, std::byte{0}));
  bench_.stop();
  EXPECT_GE(std::get<std::int64_t>(bench_.result("gateway", "parameters failed")), 1);
  EXPECT_GE(std::get<std::int64_t>(bench_.result("gateway", "parameters answered")), 1);
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("gateway", "parameters lost")), 0);
}

INSTANTIATE_TEST_SUITE_P(Engines, ParamServicesTest, ::testing::ValuesIn([] {
                           std::vector<const char*> all;
                           for (const Engine& engine : engines()) {
                             all.push_back(engine.name);
                           }
                           return all;
                         }()),
                         [](const auto& engine) { return std::string(engine.param); });

TEST(ParamServices, ListWhatIsBelowAPrefixToADepth) {
  const std::vector<std::string> names = {"a.x", "a.limits.jerk", "a.limits.max.x", "ab.x"};

  EXPECT_EQ(listed_names(names, {}, 0), names);
  EXPECT_THAT(listed_names(names, {"a"}, 0), ElementsAre("a.x", "a.limits.jerk", "a.limits.max.x"));
  EXPECT_THAT(listed_names(names, {"a"}, 2), ElementsAre("a.x", "a.limits.jerk"));
  EXPECT_THAT(listed_names(names, {"a.limits", "ab.x"}, 1), ElementsAre("a.limits.jerk", "ab.x"));
  EXPECT_THAT(listed_names(names, {}, 2), ElementsAre("a.x", "ab.x"));
}

TEST(RosParams, AreWrittenAndReadAlike) {
  const std::vector<RosParamValue> values = {{},
                                             true,
                                             std::int64_t{-7},
                                             2.5,
                                             std::string("text"),
                                             std::vector<std::uint8_t>{1, 255},
                                             std::vector<bool>{true, false},
                                             std::vector<std::int64_t>{1, -1},
                                             std::vector<double>{0.5},
                                             std::vector<std::string>{"a", ""}};
  for (std::size_t i = 0; i < values.size(); ++i) {
    ros2::Buffer bytes;
    ros2::CdrWriter out(bytes);
    write(values[i], out);
    out.end();
    ros2::CdrReader in(bytes.bytes());

    EXPECT_EQ(read_param_value(in), values[i]) << i;
    EXPECT_EQ(values[i].index(), i);
  }
}

TEST(RosParams, HaveTheTypesOfOurs) {
  const auto value = [](const char* type, const char* json) {
    return ros_value_of({.type = type, .json = json});
  };
  EXPECT_EQ(value("bool[]", "[true]"), RosParamValue(std::vector<bool>{true}));
  EXPECT_EQ(value("integer", "7"), RosParamValue(std::int64_t{7}));
  EXPECT_EQ(value("integer", "18446744073709551615"), RosParamValue());  // There is no room for it.
  EXPECT_EQ(value("number", "7"), RosParamValue(7.0));
  EXPECT_EQ(value("path[]", R"(["a"])"), RosParamValue(std::vector<std::string>{"a"}));
  EXPECT_EQ(value("message basic.Text", R"({"data":"x"})"),
            RosParamValue(std::string(R"({"data":"x"})")));
  EXPECT_EQ(value("", ""), RosParamValue());
}

TEST(RosParams, ThatCanBeNoValueOfOursAreNone) {
  const ParamInfo number{.type = "number"};
  const ParamInfo message{.type = "message basic.Text"};
  EXPECT_EQ(json_of(number, RosParamValue()), std::nullopt);
  EXPECT_EQ(json_of(number, std::nan("")), std::nullopt);
  EXPECT_EQ(json_of(number, std::vector<double>{1.0, HUGE_VAL}), std::nullopt);
  EXPECT_EQ(json_of(message, std::string("{")), std::nullopt);
  EXPECT_EQ(json_of(message, std::string(R"({"data": 1})")), R"({"data":1})");
  EXPECT_EQ(json_of(number, std::string("7")), "\"7\"");
  EXPECT_EQ(json_of(number, std::int64_t{7}), "7");
}

}  // namespace
}  // namespace fastcycle::dds_gateway
