#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "config/value.h"
#include "host/application.h"

namespace fastcycle::host {

/// One parameter for a tool. Values are as the application file would write them.
struct ListedParam {
  std::string component;
  std::string name;
  std::string type;  ///< "number", "number[]", "enum", "message demo.Limits".
  std::string unit;
  nlohmann::ordered_json min;  ///< Null: none.
  nlohmann::ordered_json max;
  std::vector<std::string> names;  ///< Of an enumeration.
  bool has_fallback = false;
  nlohmann::ordered_json fallback;
  nlohmann::ordered_json value;
  std::string origin;   ///< "default", "file", "shared", "changed".
  config::Place place;  ///< If a file or an option set it.
  bool is_tunable = false;
  std::string description;

  /// Its name for `ParamChange::param`.
  [[nodiscard]] std::string full_name() const { return component + "." + name; }
};

/// The parameters of all components, in the order of the file, with their committed values. Safe.
[[nodiscard]] std::vector<ListedParam> list_params(const Application& application);

[[nodiscard]] std::string to_table(const std::vector<ListedParam>& params);
[[nodiscard]] std::string to_markdown(const std::vector<ListedParam>& params);
/// An array of objects, indented.
[[nodiscard]] std::string to_json(const std::vector<ListedParam>& params);

}  // namespace fastcycle::host
