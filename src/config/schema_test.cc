#include "config/schema.h"

#include <set>
#include <string>

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/parse.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

using nlohmann::json;

const std::filesystem::path kSourceFolder = FASTCYCLE_SOURCE_FOLDER;

std::string content_of(const std::filesystem::path& file) {
  Problems problems;
  return read_file(file, {}, problems).value();
}

/// All keys that some object of the schema may have.
void add_keys(const json& schema, std::set<std::string>& keys) {
  if (schema.is_object()) {
    const json properties = schema.value("properties", json::object());
    for (const auto& [key, property] : properties.items()) {
      keys.insert(key);
    }
  }
  if (schema.is_structured()) {
    for (const json& part : schema) {
      add_keys(part, keys);
    }
  }
}

/// All properties that say nothing to who completes a key in an editor.
void add_undescribed(const json& schema, const std::string& at, std::set<std::string>& names) {
  if (!schema.is_object()) {
    return;
  }
  const json properties = schema.value("properties", json::object());
  for (const auto& [key, property] : properties.items()) {
    const bool is_elsewhere = property.contains("$ref") && property.size() == 1;
    if (!property.contains("description") && !is_elsewhere) {
      names.insert(at + '/' + key);
    }
  }
  for (const auto& [key, part] : schema.items()) {
    add_undescribed(part, at + '/' + key, names);
  }
}

TEST(Schema, BuiltInOneIsTheInstalledOne) {
  EXPECT_EQ(built_in_schema(), content_of(kSourceFolder / "schema/application.schema.json"));
}

TEST(Schema, EveryKeyIsDescribed) {
  std::set<std::string> undescribed;

  add_undescribed(json::parse(built_in_schema()), "", undescribed);

  EXPECT_EQ(undescribed, std::set<std::string>());
}

TEST(Schema, EveryKeyIsInTheReference) {
  const std::string reference = content_of(kSourceFolder / "docs/reference/configuration.md");
  std::set<std::string> keys;

  add_keys(json::parse(built_in_schema()), keys);

  EXPECT_GT(keys.size(), 30U);
  for (const std::string& key : keys) {
    EXPECT_NE(reference.find('`' + key + '`'), std::string::npos) << key;
  }
}

TEST(Schema, LongNamesAreNoDanger) {
  const TestFolder folder;
  const std::string name(5'000'000, 'a');
  const auto file = folder.write(
      "app.json", "{\"name\": \"" + name + "\", \"components\": [{\"name\": \"" + name + "\"}]}");
  Problems problems;

  (void)load({.file = file}, problems);

  EXPECT_EQ(problems.all().size(), 3U) << "two names and a library";
}

TEST(Schema, LongListsAreNoDanger) {
  const TestFolder folder;
  std::string zeros = "[0";
  for (int i = 0; i < 200'000; ++i) {
    zeros += ",0";
  }
  zeros += ']';
  Problems components;
  Problems cpus;

  (void)load({.file = folder.write("1.json", "{\"components\": " + zeros + "}")}, components);
  (void)load({.file = folder.write("2.json", "{\"executors\": [{\"cpus\": " + zeros + "}]}")},
             cpus);

  EXPECT_NE(text_of(components).find("/components: expected a list of at most 1000 items"),
            std::string::npos);
  EXPECT_NE(text_of(cpus).find("/executors/0/cpus: expected a list of different CPU numbers"),
            std::string::npos);
}

}  // namespace
}  // namespace fastcycle::config
