// The pairs of the public conformance suite: X.mcap, and X.json that says what is in it and with
// which features it was written. A few are here, under tests/data/mcap; all that the folder
// $FASTCYCLE_DATA/mcap_conformance has are taken as well.

#include "conformance.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "mcap/file.h"
#include "mcap/reader.h"
#include "mcap/record_reader.h"
#include "process/process.h"

namespace fastcycle::conformance {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

const std::filesystem::path kShipped = std::filesystem::path(FASTCYCLE_TEST_DATA) / "mcap";

std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The .json files in and below `folder`.
std::vector<std::filesystem::path> descriptions_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".json") {
      files.push_back(entry.path());
    }
  }
  std::ranges::sort(files);
  return files;
}

bool is_padded(const Json& description) {
  const Json& features = description["meta"]["variant"]["features"];
  return std::ranges::find(features, "pad") != features.end();
}

std::string written(const Json& description) {
  mcap::MemorySink sink;
  write_file(description, sink);
  return std::string(mcap::text_of(sink.bytes()));
}

/// The log times of the messages that `Reader` finds, and of those that the description has.
void expect_same_messages(const std::string& file, const Json& records) {
  std::vector<std::uint64_t> expected;
  for (const Json& record : records) {
    if (record["type"] == "Message") {
      expected.push_back(std::stoull(record["fields"][2][1].get<std::string>()));
    }
  }
  std::ranges::sort(expected);
  const mcap::MemorySource source(mcap::bytes_of(file));
  const mcap::Reader reader(source);
  mcap::MessageReader messages = reader.messages();
  std::vector<std::uint64_t> found;
  while (const auto message = messages.next()) {
    found.push_back(message->log_time_ns);
  }
  EXPECT_EQ(found, expected);
}

/// Reads and writes each pair; how many there are.
std::size_t check_pairs(const std::filesystem::path& folder) {
  const std::vector<std::filesystem::path> files = descriptions_in(folder);
  for (const std::filesystem::path& file : files) {
    SCOPED_TRACE(file.string());
    const Json description = Json::parse(content_of(file));
    std::filesystem::path pair = file;
    const std::string bytes = content_of(pair.replace_extension(".mcap"));
    const mcap::MemorySource source(mcap::bytes_of(bytes), pair.string());

    EXPECT_EQ(read_records(source), description["records"]);
    expect_same_messages(bytes, description["records"]);
    if (!is_padded(description)) {
      EXPECT_EQ(written(description), bytes);
    }
  }
  return files.size();
}

TEST(Conformance, ShippedPairsAreReadAndWritten) {
  EXPECT_EQ(check_pairs(kShipped), 12U);
}

TEST(Conformance, AllPairsOfTheSuiteAreReadAndWritten) {
  const char* const data = std::getenv("FASTCYCLE_DATA");
  if (data == nullptr) {
    GTEST_SKIP() << "FASTCYCLE_DATA is not set";
  }
  const std::filesystem::path folder = std::filesystem::path(data) / "mcap_conformance";
  if (!std::filesystem::is_directory(folder)) {
    GTEST_SKIP() << "there is no folder " << folder;
  }

  EXPECT_GT(check_pairs(folder), 0U);
}

/// A description of messages at these log times, one after the other, written with `features`.
Json messages_at(const std::vector<std::uint64_t>& times, std::vector<std::string> features) {
  const auto record = [](const char* type, const std::vector<std::pair<std::string, Json>>& pairs) {
    Json fields = Json::array();
    for (const auto& [name, value] : pairs) {
      fields.push_back(Json::array({name, value}));
    }
    return Json{{"type", type}, {"fields", std::move(fields)}};
  };
  Json records = Json::array();
  records.push_back(record("Header", {{"library", ""}, {"profile", ""}}));
  records.push_back(record("Channel", {{"id", "7"},
                                       {"message_encoding", "text"},
                                       {"metadata", Json::object()},
                                       {"schema_id", "0"},
                                       {"topic", "words"}}));
  for (const std::uint64_t time : times) {
    records.push_back(record("Message", {{"channel_id", "7"},
                                         {"data", Json::array({"0", "255"})},
                                         {"log_time", std::to_string(time)},
                                         {"publish_time", "18446744073709551615"},
                                         {"sequence", "4294967295"}}));
  }
  records.push_back(record("DataEnd", {{"data_section_crc", "0"}}));
  return {{"records", std::move(records)},
          {"meta", {{"variant", {{"features", std::move(features)}}}}}};
}

TEST(Conformance, EveryCombinationOfFeaturesIsReadBack) {
  const std::vector<std::string> all{"ch", "mx", "st", "rsh", "rch", "ax", "mdx", "chx", "sum"};
  for (std::size_t set = 0; set < std::size_t{1} << all.size(); ++set) {
    std::vector<std::string> features;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if ((set >> i & 1U) != 0) {
        features.push_back(all[i]);
      }
    }
    const Json description = messages_at({0, 2, 1, 3, 3, 5, 4}, features);
    const std::string file = written(description);
    const mcap::MemorySource source(mcap::bytes_of(file));

    const Json records = read_records(source);

    // What was to be written, up to the DataEnd, whose CRC is not known before.
    const auto before_end = static_cast<std::ptrdiff_t>(description["records"].size()) - 1;
    ASSERT_TRUE(
        std::equal(records.begin(), records.begin() + before_end, description["records"].begin()))
        << set;
    EXPECT_EQ(records.at(static_cast<std::size_t>(before_end))["type"], "DataEnd");
    expect_same_messages(file, description["records"]);
  }
}

std::string error_of_writing(const Json& description) {
  try {
    (void)written(description);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(Conformance, DescriptionThatCannotBeWrittenSaysWhere) {
  Json number = messages_at({1}, {});
  number["records"][2]["fields"][4][1] = "4294967296";
  Json type = messages_at({1}, {});
  type["records"][2]["type"] = "Massage";
  Json endless = messages_at({1}, {});
  endless["records"].erase(3);

  EXPECT_EQ(error_of_writing(number),
            "/records/2/fields/4/1: expected a whole number from 0 to 4294967295, as a text, found "
            "\"4294967296\"");
  EXPECT_THAT(error_of_writing(type), HasSubstr("/records/2/type: expected Schema, Channel"));
  EXPECT_THAT(error_of_writing(endless), HasSubstr("/records: expected a list with a DataEnd"));
  EXPECT_THAT(error_of_writing(messages_at({1}, {"st", "pad"})), HasSubstr("features/1"));
  EXPECT_THAT(error_of_writing(messages_at({1}, {"xyz"})), HasSubstr("expected one of ch, mx"));
  EXPECT_THAT(error_of_writing(Json::array()), HasSubstr("an object with \"meta\""));
}

/// How the program ends.
struct Ran {
  int exit_code = 0;
  std::string output;
  std::string errors;
};

Ran run(std::vector<std::string> arguments) {
  test::Process process({.program = MCAP_CONFORMANCE_PROGRAM, .arguments = std::move(arguments)});
  const int exit_code = process.wait().exit_code;
  return {exit_code, process.output(), process.errors()};
}

TEST(ConformanceProgram, ReadsAndWritesAsTheSuiteAsks) {
  const std::filesystem::path pair = kShipped / "OneMessage-ch-chx-mx-rch-rsh-st-sum";

  const Ran read = run({"read", pair.string() + ".mcap"});
  const Ran write = run({"write", pair.string() + ".json"});

  EXPECT_EQ(read.exit_code, 0) << read.errors;
  EXPECT_EQ(Json::parse(read.output), Json::parse(content_of(pair.string() + ".json"))["records"]);
  EXPECT_EQ(write.exit_code, 0) << write.errors;
  EXPECT_EQ(write.output, content_of(pair.string() + ".mcap"));
}

TEST(ConformanceProgram, WhatFailsIsSaidAndTheExitCodeIsOne) {
  const Ran missing = run({"read", "/nowhere/X.mcap"});
  const Ran no_mcap = run({"read", (kShipped / "NoData.json").string()});
  const Ran padded = run({"write", (kShipped / "OneAttachment-pad.json").string()});
  const Ran no_json = run({"write", (kShipped / "NoData.mcap").string()});

  for (const Ran& ran : {missing, no_mcap, padded, no_json}) {
    EXPECT_EQ(ran.exit_code, 1);
    EXPECT_EQ(ran.output, "");
    EXPECT_THAT(ran.errors, HasSubstr("mcap_conformance: /"));
  }
  EXPECT_THAT(missing.errors, HasSubstr("No such file"));
  EXPECT_THAT(no_mcap.errors, HasSubstr("byte 0: expected the magic bytes of MCAP"));
  EXPECT_THAT(padded.errors, HasSubstr("pad"));
}

TEST(ConformanceProgram, WrongCommandLineIsExitCodeTwo) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{}, {"read"}, {"sing", "x.mcap"}, {"read", "a", "b"}}) {
    const Ran ran = run(arguments);

    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_THAT(ran.errors, HasSubstr("usage: mcap_conformance read FILE.mcap"));
  }
  EXPECT_EQ(run({"--help"}).exit_code, 0);
}

}  // namespace
}  // namespace fastcycle::conformance
