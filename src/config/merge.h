#pragma once

#include <string>
#include <vector>

#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// Merges `over` into `base`: objects are merged key by key, null deletes, all else is replaced. A
/// null for a missing key is an error.
///
/// @pre  both are objects
void merge(Value& base, const Value& over, Problems& problems);

/// The keys of an object.
[[nodiscard]] std::vector<std::string> keys_of(const Value& object);

/// The member `key` if it is of that type; none otherwise. The schema check reports wrong types.
[[nodiscard]] const Value* find_object(const Value& object, std::string_view key);
[[nodiscard]] const Value* find_array(const Value& object, std::string_view key);
[[nodiscard]] const Value* find_string(const Value& object, std::string_view key);
/// The text of `find_string`, empty if there is none.
[[nodiscard]] std::string text_of(const Value& object, std::string_view key);

/// `front/limiter` of `front` and `limiter`; an empty part is left out.
[[nodiscard]] std::string joined(const std::string& name_space, const std::string& name);
/// `joined`, unless `name` begins with a slash: then it is full already and stays as it is.
[[nodiscard]] std::string placed(const std::string& name_space, const std::string& name);
/// Without the slash in front.
[[nodiscard]] std::string without_slash(std::string name);
/// The full name of a component of the tree; empty if it has no name.
[[nodiscard]] std::string full_name(const Value& component);

}  // namespace fastcycle::config
