#include "config/merge.h"

#include <utility>

#include "config/nearest.h"

namespace fastcycle::config {

namespace {

const Value* find_of_type(const Value& object, std::string_view key, Value::Type type) {
  const Value* value = object.find(key);
  return value != nullptr && value->type() == type ? value : nullptr;
}

}  // namespace

void merge(Value& base, const Value& over, Problems& problems) {
  for (const auto& [key, value] : over.members()) {
    Value* old = base.find(key);
    if (value.is_null()) {
      if (!base.erase(key)) {
        problems.add(make_error(value.place(),
                                "null deletes " + in_quotes(key) + ", but there is no such key",
                                did_you_mean(nearest(key, keys_of(base)))));
      }
    } else if (!value.is_object()) {
      base.set(key, value);
    } else if (old != nullptr && old->is_object()) {
      merge(*old, value, problems);
    } else {
      Value fresh = Value::object_at(value);
      merge(fresh, value, problems);
      base.set(key, std::move(fresh));
    }
  }
}

std::vector<std::string> keys_of(const Value& object) {
  std::vector<std::string> result;
  for (const auto& member : object.members()) {
    result.push_back(member.key);
  }
  return result;
}

const Value* find_object(const Value& object, std::string_view key) {
  return find_of_type(object, key, Value::Type::kObject);
}

const Value* find_array(const Value& object, std::string_view key) {
  return find_of_type(object, key, Value::Type::kArray);
}

const Value* find_string(const Value& object, std::string_view key) {
  return find_of_type(object, key, Value::Type::kString);
}

std::string text_of(const Value& object, std::string_view key) {
  const Value* value = find_string(object, key);
  return value == nullptr ? std::string() : value->as_string();
}

std::string joined(const std::string& name_space, const std::string& name) {
  if (name_space.empty() || name.empty()) {
    return name_space + name;
  }
  return name_space + '/' + name;
}

std::string placed(const std::string& name_space, const std::string& name) {
  return name.starts_with('/') ? name : joined(name_space, name);
}

std::string without_slash(std::string name) {
  return name.starts_with('/') ? name.substr(1) : name;
}

std::string full_name(const Value& component) {
  const std::string name = text_of(component, "name");
  return name.empty() ? name : joined(text_of(component, "namespace"), name);
}

}  // namespace fastcycle::config
