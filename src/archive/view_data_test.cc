#include "archive/view_data.h"

#include <array>
#include <cstring>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/test_log.h"

namespace fastcycle::archive {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Viewed {
  json page;
  ViewData data;
};

Viewed viewed(const std::string& file, const std::string& view, const ViewOptions& options = {}) {
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  const mcap::Reader reader(source);
  const std::array files{&reader};
  Viewed result;
  result.data = view_data(files, view, options);
  result.page = json::parse(result.data.json);
  return result;
}

/// Of one layer with these fields.
Viewed fields(const std::string& file, const std::string& fields, const std::string& more = "") {
  return viewed(
      file, R"({"layers": {"it": {"topic": "scene", )" + more + R"("fields": )" + fields + "}}}");
}

json messages(const Viewed& viewed) {
  return viewed.page.at("layers").at("it").at("messages");
}

std::string error_of(const std::string& view) {
  try {
    (void)viewed(scenes({"name: 'a'"}), view);
  } catch (const ViewError& error) {
    return error.what();
  }
  return "";
}

std::string failure(const std::string& file, const std::string& view,
                    const ViewOptions& options = {}) {
  try {
    (void)viewed(file, view, options);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(ViewData, PicksFieldsByOtherNamesAndRoundsThem) {
  const Viewed result =
      fields(scenes({"name: 'a' origin { x: 1.23456 } kind: YARD", "origin { x: -0.0001 }", ""}),
             R"({"word": "name", "x": {"from": "origin.x", "decimals": 2}, "kind": "kind"})");

  EXPECT_EQ(result.page["layers"]["it"]["names"], json::parse(R"(["word", "x", "kind"])"));
  EXPECT_EQ(messages(result),
            json::parse(R"([[0, "a", 1.23, "YARD"], [0, "", 0, "ROAD"], [0, "", null, "ROAD"]])"));
  EXPECT_EQ(result.data.messages, 3U);
  EXPECT_TRUE(result.data.left_out.empty());
}

TEST(ViewData, MessagesWithinAreArraysOfTheirValues) {
  const Viewed result =
      fields(scenes({"points { x: 1 } points { x: 2 y: 3 } points { x: 4 } ranges: [5, 6, 7]", ""}),
             R"({"all": {"from": "points", "fields": {"x": "x", "y": "y"}},
          "few": {"from": "points", "every": 2, "fields": {"x": "x"}}, "ranges": "ranges"})");

  EXPECT_EQ(result.page["layers"]["it"]["names"],
            json::parse(R"([["all",["x","y"]],["few",["x"]],"ranges"])"));
  EXPECT_EQ(messages(result),
            json::parse("[[0,[[1,0],[2,3],[4,0]],[[1],[4]],[5,6,7]],[0,[],[],[]]]"));
}

TEST(ViewData, WhatIsNoNumberOrEndsThePageIsWrittenSoThatItMayStandThere) {
  const Viewed result = fields(scenes({"name: '</script>' origin { x: inf y: nan }"}),
                               R"({"name": "name", "x": "origin.x", "y": "origin.y"})");

  EXPECT_EQ(result.data.json.find('<'), std::string::npos);
  EXPECT_EQ(messages(result), json::parse(R"([[0,"</script>",null,null]])"));
}

TEST(ViewData, PointsAreThinnedAndPacked) {
  std::string bytes;
  for (const std::array<float, 3> point :
       {std::array{1.0F, -2.0F, 0.5F}, std::array{0.0F, 0.0F, 0.0F}, std::array{3.0F, 0.0F, 0.0F},
        std::array{900.0F, 0.0F, 0.0F}}) {
    std::array<char, 16> record{};
    std::memcpy(record.data(), point.data(), sizeof(point));
    record[12] = '\x01';
    bytes.append(record.data(), record.size());
  }
  std::string escaped;
  for (const char letter : bytes) {
    escaped += fmt::format("\\{:03o}", static_cast<unsigned char>(letter));
  }
  const auto points = [](int most) {
    return R"({"points": {"from": "image", "points":
           {"stride": 16, "x": 0, "y": 4, "z": 8, "time": 12, "most": )" +
           std::to_string(most) + "}}}";
  };

  // 100, -200, 50 and 1; 300, 0, 0 and 1. No echo, and what is too far for 16 bits, is left out.
  EXPECT_EQ(messages(fields(scenes({"image: '" + escaped + "'"}), points(9)))[0][1],
            "ZAA4/zIAAQAsAQAAAAABAA==");
  EXPECT_EQ(messages(fields(scenes({"image: '" + escaped + "'"}), points(1)))[0][1],
            "ZAA4/zIAAQA=");
}

TEST(ViewData, FilesOfALogAreReadInTheOrderOfTheirTimes) {
  const std::string first_file = scenes({"name: 'a'", "name: 'c'"});
  const std::string second_file = scenes({"name: 'b'", "name: 'd'"});
  const mcap::MemorySource first(mcap::bytes_of(first_file), "1.mcap");
  const mcap::MemorySource second(mcap::bytes_of(second_file), "2.mcap");
  const mcap::Reader first_reader(first);
  const mcap::Reader second_reader(second);
  const std::array files{&first_reader, &second_reader};

  const ViewData data =
      view_data(files, R"({"layers": {"it": {"topic": "scene", "fields": {"name": "name"}}}})", {});

  const json page = json::parse(data.json);
  EXPECT_EQ(data.messages, 4U);
  EXPECT_EQ(page["layers"]["it"]["messages"],
            json::parse(R"([[0, "a"], [0, "b"], [0, "c"], [0, "d"]])"));
}

TEST(ViewData, ALayerMayHaveFewerMessages) {
  // 10 ns apart.
  const std::string file = scenes({"name: 'a'", "name: 'b'", "name: 'c'", "name: 'd'"});

  EXPECT_EQ(messages(fields(file, R"({"n": "name"})", R"("most_hz": 100000, )")).size(), 1U);
}

TEST(ViewData, OfALatchedTopicWhatCameBeforeCountsAsWell) {
  const std::string file = scenes({"name: 'a'", "name: 'b'", "name: 'c'"});
  const auto names = [&](const std::string& more) {
    const Viewed result = viewed(
        file, R"({"layers": {"it": {"topic": "scene", )" + more + R"("fields": {"n": "name"}}}})",
        {.begin_ns = 1010, .end_ns = 1020});
    std::string all;
    for (const json& message : messages(result)) {
      all += message[1].get<std::string>();
    }
    return all;
  };

  EXPECT_EQ(names(""), "b");
  EXPECT_EQ(names(R"("latched": true, )"), "ab");
}

TEST(ViewData, ALayerThatTheLogDoesNotHaveIsNamed) {
  const Viewed result = viewed(scenes({"name: 'a'"}), R"({"constants": {"long": 4}, "layers": {
      "it": {"topic": "scene", "fields": {"n": "name"}},
      "none": {"topic": "nothing", "fields": {"n": "name"}},
      "other": {"topic": "scene", "fields": {"n": "origin.z"}},
      "whole": {"topic": "scene", "fields": {"n": "origin"}},
      "deep": {"topic": "scene", "fields": {"n": "points.x"}},
      "bytes": {"topic": "scene", "fields": {"n": "image"}},
      "time": {"topic": "scene", "fields": {"n": {"from": "name", "time": true}}}}})");

  EXPECT_EQ(result.page["constants"]["long"], 4);
  EXPECT_EQ(result.page["layers"].size(), 1U);
  EXPECT_THAT(
      result.data.left_out,
      ElementsAre("none (nothing): no messages", "other (scene): demo.Scene has no field origin.z",
                  "whole (scene): origin of demo.Scene is no single value",
                  "deep (scene): demo.Scene has no field points.x",
                  "bytes (scene): image of demo.Scene is no value that can be shown",
                  "time (scene): name of demo.Scene is no time: a number of 64 bits"));
}

TEST(ViewData, AMessageThatCannotBeReadTakesNoOtherWithIt) {
  mcap::WriterOptions options = mcap::small_chunks();
  options.chunk.crc = false;
  std::string file = scenes({"name: 'first'", "name: 'wrong'", "name: 'last'"}, options);
  file.replace(file.find("wrong"), 1, "\xFF");

  const Viewed result = fields(file, R"({"n": "name"})");

  EXPECT_EQ(messages(result), json::parse(R"([[0, "first"], [0, "last"]])"));
  EXPECT_THAT(
      result.data.left_out,
      ElementsAre("it (scene): 1 message, the first: no UTF-8 in the text demo.Scene.name"));
}

TEST(ViewData, NothingToDrawIsAnErrorAndSoIsTooMuch) {
  const std::string file = scenes({"name: 'a'", "name: 'b'"});

  EXPECT_EQ(failure(file, R"({"layers": {"it": {"topic": "t", "fields": {"n": "name"}}}})"),
            "there is nothing to draw: the log has scene (--view names topics and fields to draw); "
            "it (t): "
            "no messages");
  EXPECT_THAT(failure(file, R"({"layers": {"it": {"topic": "scene", "fields": {"n": "name"}}}})",
                      {.most_bytes = 8}),
              HasSubstr("--start"));
}

TEST(ViewData, ATimeBehindTheLogIsAnError) {
  EXPECT_THAT(failure(scenes({"name: 'a'"}),
                      R"({"layers": {"it": {"topic": "scene", "latched": true,
                                     "fields": {"n": "name"}}}})",
                      {.begin_ns = 5000}),
              HasSubstr("the log ends before that"));
}

TEST(ViewData, WhatIsWrongWithAViewIsSaidWithItsPlace) {
  EXPECT_EQ(error_of("{"), "expected JSON, found a syntax error at byte 2");
  EXPECT_EQ(error_of("7"), "/: expected an object, found 7");
  EXPECT_EQ(error_of("{}"), "/: expected an object with \"layers\", found {}");
  EXPECT_EQ(error_of(R"({"layers": {}})"), "/layers: expected an object of layers, found {}");
  EXPECT_EQ(error_of(R"({"layers": {"a": {"topik": 1}}})"),
            "/layers/a/topik: there is no such key");
  EXPECT_EQ(error_of(R"({"layers": {"a": {"topic": "t", "fields": {"x": 3}}}})"),
            "/layers/a/fields/x: expected an object, found 3");
  EXPECT_EQ(
      error_of(R"({"layers": {"a": {"topic": "t", "fields": {"x": {"from": "f", "every": 0}}}}})"),
      "/layers/a/fields/x/every: expected a whole number in [1, 1000000], found 0");
}

}  // namespace
}  // namespace fastcycle::archive
