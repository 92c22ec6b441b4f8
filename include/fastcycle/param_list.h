#pragma once

#include <string>
#include <vector>

namespace fastcycle {

class Context;

/// Description of a parameter of any component of the application.
struct ParamInfo {
  std::string param = {};               ///< As `ParamChange::param`.
  std::string type = {};                ///< "number", "integer[]", "enum", "message demo.Limits".
  std::string json = {};                ///< Its value, as `ParamChange::json`.
  std::string min_json = {};            ///< Of numbers; empty if the author gave none.
  std::string max_json = {};            ///< The same.
  std::vector<std::string> names = {};  ///< Of an enumeration.
  std::string unit = {};                ///< As the author gave it: "m/s"; may be empty.
  std::string description = {};         ///< The same.
  bool is_tunable = false;              ///< Whether it may change while the application runs.
};

/// The parameters of all components, each with its value after the last transaction, in the order
/// of the application file. For a component that exports them from the application; what a
/// component needs itself is a parameter of its own, or a shared one. A recorded run records the
/// result, as `Component::observe` does.
///
/// @pre      Called in an activation of the component that `context` belongs to.
/// @threads  Confined to that component.
/// @realtime Allocates, and waits for running transactions.
[[nodiscard]] std::vector<ParamInfo> list_params(Context& context);

}  // namespace fastcycle
