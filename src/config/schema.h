#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include <nlohmann/json.hpp>

#include "config/problem.h"
#include "config/value.h"

namespace valijson {
class Schema;
}

namespace fastcycle::config {

/// The text of schema/application.schema.json, as it was when this library was built.
[[nodiscard]] std::string_view built_in_schema();

/// Checks the form of files: keys, types, words, ranges.
///
/// The verdict is the schema library's. It says neither what was expected nor what would be near,
/// so the wording is made here, from the schema's own keywords and titles.
///
/// @threads  Compatible.
class Schema {
 public:
  /// Reads `schema_file`; the built-in schema if it is empty. If that cannot be read it is a
  /// mistake, and nothing is checked.
  Schema(const std::filesystem::path& schema_file, Problems& problems);

  /// Adds a mistake for whatever in `file` is not as the schema wants it.
  void check_application(const Value& file, Problems& problems) const;
  /// The same for an overlay: there null may stand for everything.
  void check_overlay(const Value& file, Problems& problems) const;
  /// The same for the file of one component.
  void check_component_file(const Value& file, Problems& problems) const;

 private:
  // The schema of one kind of file, as JSON to word mistakes with, and as the validator reads it.
  struct Rules {
    nlohmann::json json;
    std::shared_ptr<const valijson::Schema> parsed;
  };

  static Rules make_rules(nlohmann::json json);
  static void check(const Value& file, const Rules& rules, Problems& problems);

  // Without content if the schema could not be read.
  Rules application_;
  Rules component_file_;
};

}  // namespace fastcycle::config
