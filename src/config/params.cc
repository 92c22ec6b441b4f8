#include "config/params.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "config/nearest.h"

namespace fastcycle::config {

namespace {

/// As JSON has it, but a whole number without ".0": limits are written for people.
template <typename T>
std::string as_json(T number) {
  std::string text = nlohmann::json(number).dump();
  if (text.ends_with(".0")) {
    text.resize(text.size() - 2);
  }
  return text;
}

template <typename T>
std::string in_range_text(std::string what, const Range<T>& range) {
  if (range.min && range.max) {
    return what + " in [" + as_json(*range.min) + ", " + as_json(*range.max) + "]";
  }
  if (range.min) {
    return what + " of at least " + as_json(*range.min);
  }
  return range.max ? what + " of at most " + as_json(*range.max) : what;
}

template <typename T>
bool is_in(const Range<T>& range, T number) {
  return !(range.min && number < *range.min) && !(range.max && number > *range.max);
}

std::nullopt_t refuse(const Value& value, std::string expected, Problems& problems) {
  problems.add(unexpected(value, std::move(expected)));
  return std::nullopt;
}

/// All items converted by `convert`; none if this is no list, or of the wrong size, or if an item
/// does not fit. Each wrong item is reported.
template <typename T, typename Convert>
std::optional<std::vector<T>> to_items(const Value& value, const Range<std::size_t>& size,
                                       Problems& problems, const Convert& convert) {
  if (!value.is_array()) {
    return refuse(value, "a list", problems);
  }
  if (!is_in(size, value.size())) {
    return refuse(value, in_range_text("a list with a number of items", size), problems);
  }
  std::vector<T> result;
  for (const Value& item : value.items()) {
    if (std::optional<T> one = convert(item)) {
      result.push_back(std::move(*one));
    }
  }
  return result.size() == value.size() ? std::optional(std::move(result)) : std::nullopt;
}

bool has_declared_parent(const std::string& name, const std::set<std::string>& declared) {
  for (std::size_t dot = name.find('.'); dot != std::string::npos; dot = name.find('.', dot + 1)) {
    if (declared.contains(name.substr(0, dot))) {
      return true;
    }
  }
  return false;
}

bool is_declared(const std::string& name, const std::set<std::string>& declared) {
  return declared.contains(name) || has_declared_parent(name, declared);
}

bool has_declared_child(const std::string& name, const std::set<std::string>& declared) {
  const auto next = declared.lower_bound(name + '.');
  return next != declared.end() && next->starts_with(name + '.');
}

/// A param's name as a file has it: `"a": {"b": …}` for a.b.
std::string nested(const std::string& name) {
  const std::size_t dot = name.find('.');
  return dot == std::string::npos
             ? in_quotes(name) + ": …"
             : in_quotes(name.substr(0, dot)) + ": {" + nested(name.substr(dot + 1)) + "}";
}

void check_members(const Value& object, const std::string& prefix,
                   const std::set<std::string>& declared, Problems& problems) {
  for (const auto& [key, value] : object.members()) {
    const std::string name = prefix + key;
    // A dot leads into an object, so no code can ask for a key that has one.
    const bool has_dot = key.find('.') != std::string::npos;
    if (!has_dot && is_declared(name, declared)) {
      continue;
    }
    if (!has_dot && value.is_object() && has_declared_child(name, declared)) {
      check_members(value, name + '.', declared, problems);
      continue;
    }
    Problem problem = make_error(value.place(), "there is no param " + in_quotes(name));
    problem.found = in_quotes(name);
    problem.hint = has_dot && is_declared(name, declared)
                       ? "write " + nested(name)
                       : name_hint(name, {declared.begin(), declared.end()});
    problems.add(std::move(problem));
  }
}

}  // namespace

std::optional<bool> to_bool(const Value& value, Problems& problems) {
  if (!value.is_bool()) {
    return refuse(value, "true or false", problems);
  }
  return value.as_bool();
}

std::optional<std::int64_t> to_int64(const Value& value, const Range<std::int64_t>& range,
                                     Problems& problems) {
  if (value.type() != Value::Type::kInt || !is_in(range, value.as_int64())) {
    return refuse(value, in_range_text("an integer", range), problems);
  }
  return value.as_int64();
}

std::optional<std::uint64_t> to_uint64(const Value& value, const Range<std::uint64_t>& range,
                                       Problems& problems) {
  const bool is_negative = value.type() == Value::Type::kInt && value.as_int64() < 0;
  if (!value.is_integer() || is_negative || !is_in(range, value.as_uint64())) {
    const Range<std::uint64_t> at_least{.min = range.min.value_or(0), .max = range.max};
    return refuse(value, in_range_text("an integer", at_least), problems);
  }
  return value.as_uint64();
}

std::optional<double> to_double(const Value& value, const Range<double>& range,
                                Problems& problems) {
  if (!value.is_number() || !is_in(range, value.as_double())) {
    return refuse(value, in_range_text("a number", range), problems);
  }
  return value.as_double();
}

std::optional<std::string> to_text(const Value& value, Problems& problems) {
  if (!value.is_string()) {
    return refuse(value, "a string", problems);
  }
  return value.as_string();
}

std::optional<std::size_t> to_choice(const Value& value, std::span<const std::string> names,
                                     Problems& problems) {
  const auto found = value.is_string() ? std::ranges::find(names, value.as_string()) : names.end();
  if (found != names.end()) {
    return static_cast<std::size_t>(found - names.begin());
  }
  std::string expected = "one of ";
  for (const std::string& name : names) {
    expected += (&name == names.data() ? "" : ", ") + in_quotes(name);
  }
  const std::vector<std::string> known(names.begin(), names.end());
  const std::string near = value.is_string() ? nearest(value.as_string(), known) : std::string();
  problems.add(unexpected(value, std::move(expected), shown(value), did_you_mean(near)));
  return std::nullopt;
}

std::optional<std::vector<bool>> to_bools(const Value& value, const Range<std::size_t>& size,
                                          Problems& problems) {
  return to_items<bool>(value, size, problems,
                        [&](const Value& item) { return to_bool(item, problems); });
}

std::optional<std::vector<std::int64_t>> to_int64s(const Value& value,
                                                   const VectorRange<std::int64_t>& range,
                                                   Problems& problems) {
  return to_items<std::int64_t>(value, range.size, problems, [&](const Value& item) {
    return to_int64(item, range.item, problems);
  });
}

std::optional<std::vector<std::uint64_t>> to_uint64s(const Value& value,
                                                     const VectorRange<std::uint64_t>& range,
                                                     Problems& problems) {
  return to_items<std::uint64_t>(value, range.size, problems, [&](const Value& item) {
    return to_uint64(item, range.item, problems);
  });
}

std::optional<std::vector<double>> to_doubles(const Value& value, const VectorRange<double>& range,
                                              Problems& problems) {
  return to_items<double>(value, range.size, problems,
                          [&](const Value& item) { return to_double(item, range.item, problems); });
}

std::optional<std::vector<std::string>> to_texts(const Value& value, const Range<std::size_t>& size,
                                                 Problems& problems) {
  return to_items<std::string>(value, size, problems,
                               [&](const Value& item) { return to_text(item, problems); });
}

ParamReader::ParamReader(const Value& params, const Value& shared, Problems& problems)
    : params_(params), shared_(shared), problems_(problems) {}

const Value* ParamReader::find(std::string_view name) {
  declared_.emplace(name);
  const Value* own = params_.find_dotted(name);
  return own != nullptr ? own : shared_.find_dotted(name);
}

const Value* ParamReader::require(std::string_view name) {
  const Value* value = find(name);
  if (value == nullptr) {
    problems_.add(make_error(params_.place(), "the param " + in_quotes(name) + " is missing"));
  }
  return value;
}

bool ParamReader::read_bool(std::string_view name, bool fallback) {
  const Value* value = find(name);
  return value == nullptr ? fallback : to_bool(*value, problems_).value_or(fallback);
}

std::int64_t ParamReader::read_int64(std::string_view name, std::int64_t fallback,
                                     const Range<std::int64_t>& range) {
  const Value* value = find(name);
  return value == nullptr ? fallback : to_int64(*value, range, problems_).value_or(fallback);
}

std::uint64_t ParamReader::read_uint64(std::string_view name, std::uint64_t fallback,
                                       const Range<std::uint64_t>& range) {
  const Value* value = find(name);
  return value == nullptr ? fallback : to_uint64(*value, range, problems_).value_or(fallback);
}

double ParamReader::read_double(std::string_view name, double fallback,
                                const Range<double>& range) {
  const Value* value = find(name);
  return value == nullptr ? fallback : to_double(*value, range, problems_).value_or(fallback);
}

std::string ParamReader::read_text(std::string_view name, std::string fallback) {
  const Value* value = find(name);
  return value == nullptr ? fallback : to_text(*value, problems_).value_or(std::move(fallback));
}

std::filesystem::path ParamReader::read_path(std::string_view name,
                                             std::filesystem::path fallback) {
  const Value* value = find(name);
  return value != nullptr && to_text(*value, problems_) ? value->as_path() : fallback;
}

std::size_t ParamReader::read_choice(std::string_view name, std::size_t fallback,
                                     std::span<const std::string> names) {
  const Value* value = find(name);
  return value == nullptr ? fallback : to_choice(*value, names, problems_).value_or(fallback);
}

void ParamReader::finish() {
  if (params_.is_object()) {
    check_members(params_, "", declared_, problems_);
  }
}

void check_shared(const Value& shared, const std::set<std::string>& declared, Problems& problems) {
  if (shared.is_object()) {
    check_members(shared, "", declared, problems);
  }
}

}  // namespace fastcycle::config
