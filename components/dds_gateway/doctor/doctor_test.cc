// The program as the tool runs it, in a network of its own with loopback alone.
#include <array>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "dds_gateway/doctor/listener.h"
#include "dds_gateway/test_network.h"

namespace fastcycle::dds_gateway {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Json = nlohmann::json;

constexpr const char* kString = "std_msgs::msg::dds_::String_";

/// What the program says, and its exit code.
struct Output {
  std::string text;
  int code = -1;
};

Output run(const std::string& args) {
  Output output;
  std::FILE* const pipe =
      popen(fmt::format("'{}' {} 2>&1", FASTCYCLE_DDS_DOCTOR, args).c_str(), "r");
  std::array<char, 4096> part{};
  for (std::size_t size = 0; (size = std::fread(part.data(), 1, part.size(), pipe)) > 0;) {
    output.text.append(part.data(), size);
  }
  output.code = WEXITSTATUS(pclose(pipe));
  return output;
}

class Doctor : public ::testing::TestWithParam<const char*> {
 protected:
  static Output look(unsigned domain, const char* form = "JSON") {
    return run(fmt::format("look {} {} {} lo '' 6000", form, GetParam(), domain));
  }
  static std::string sentence(const Json& json, const std::string& name) {
    for (const Json& finding : json["findings"]) {
      if (finding["name"] == name) {
        return finding["found"];
      }
    }
    return "nothing";
  }
};

TEST_P(Doctor, FindsNodesAndWhyNoMessagePassesBetweenThem) {
  for (const Engine& other : engines()) {
    const Peer writer(other.name,
                      {"echo", "rt/unused", "rt/points", kString, "best_effort", "volatile"});
    const Peer reader(GetParam(),
                      {"echo", "rt/points", "rt/unused_too", kString, "reliable", "volatile"});

    const Output output = look(domain_of_test());

    EXPECT_EQ(output.code, 3) << output.text;
    const Json json = Json::parse(output.text, nullptr, false);
    ASSERT_TRUE(json.is_object()) << output.text;
    EXPECT_EQ(json["participants"].size(), 2U);
    EXPECT_THAT(sentence(json, "quality"),
                AllOf(HasSubstr("/points: from /peer to /peer no message passes"),
                      HasSubstr("written best effort, volatile, read reliable, volatile")));
    EXPECT_THAT(sentence(json, "round trip"), HasSubstr("64 B there and back in"));
    EXPECT_EQ(json["round_trip_us"]["1 MiB"]["count"], 20);
  }
}

TEST_P(Doctor, FindsThatOthersAreInAnotherDomain) {
  const Peer other(GetParam(), {"echo", "rt/a", "rt/b", kString, "reliable", "volatile"});
  const unsigned empty = domain_of_test() + 1;

  const Output output = look(empty, "TEXT");

  EXPECT_EQ(output.code, 3);
  EXPECT_THAT(output.text,
              AllOf(HasSubstr(fmt::format("nobody was found in the domain {} within 6 s", empty)),
                    HasSubstr(fmt::format("there are participants in the domain {} on this machine",
                                          domain_of_test()))));
}

INSTANTIATE_TEST_SUITE_P(Engines, Doctor, ::testing::ValuesIn([] {
                           std::vector<const char*> all;
                           for (const Engine& engine : engines()) {
                             all.push_back(engine.name);
                           }
                           return all;
                         }()),
                         [](const auto& engine) { return std::string(engine.param); });

TEST(DoctorProgram, RefusesWhatIsNotThere) {
  const Output interface = run("look TEXT '' 0 none0 '' 100");
  EXPECT_EQ(interface.code, 2);
  EXPECT_THAT(interface.text, HasSubstr("there is no network interface \"none0\"; there are"));

  const Output engine = run("look TEXT slow 0 lo '' 100");
  EXPECT_EQ(engine.code, 2);
  EXPECT_THAT(engine.text, HasSubstr("--engine expects one of"));

  const Output enclave = run("look TEXT '' 0 lo /nowhere 100");
  EXPECT_EQ(enclave.code, 2);
  EXPECT_THAT(enclave.text, HasSubstr("/nowhere"));
}

}  // namespace
}  // namespace fastcycle::dds_gateway
