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
/// The schema library validates. It reports neither the expected nor the nearest value, so messages
/// are composed here, from the schema's keywords and titles.
///
/// @threads  Compatible.
class Schema {
 public:
  /// Reads `schema_file`; the built-in schema if it is empty. If that cannot be read it is an
  /// error, and nothing is checked.
  Schema(const std::filesystem::path& schema_file, Problems& problems);

  /// Adds an error for each violation of the schema in `file`.
  void check_application(const Value& file, Problems& problems) const;
  /// The same for an overlay, in which any value may be null.
  void check_overlay(const Value& file, Problems& problems) const;
  /// The same for the file of one component.
  void check_component_file(const Value& file, Problems& problems) const;

 private:
  // The schema of one kind of file: as JSON to compose messages from, and in the validator's form.
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
