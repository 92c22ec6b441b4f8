#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace fastcycle::config {

/// Where a value was written: the location that errors refer to.
struct Place {
  std::string file;     ///< As the user named it; or the option, `--set limiter.limit_mps=20`.
  int line = 0;         ///< Counted from 1; 0 if there are no lines, as for an option.
  std::string pointer;  ///< JSON pointer within that file; empty for the whole of it.

  friend bool operator==(const Place&, const Place&) = default;
};

/// `file:line: /pointer`, without the parts that the place does not have.
[[nodiscard]] std::string to_string(const Place& place);

/// One file or one option that values come from. Shared by all values of it.
struct Source {
  std::string name;              ///< Shown in errors.
  std::filesystem::path folder;  ///< Where relative paths start; empty: the working folder.
  bool has_lines = true;         ///< False for an option.
};

/// A JSON value in which every part has the place where it was written.
///
/// A value keeps its place when the tree around it is included, merged or replaced. Objects keep
/// the order of their keys.
///
///     const Value* period = component.find("serve_period_ms");
///     if (period != nullptr && period->is_number()) { use(period->as_double()); }
///
/// @threads  Compatible.
/// @realtime Never used while driving: it allocates.
class Value {
 public:
  enum class Type : std::uint8_t { kNull, kBool, kInt, kUint, kDouble, kString, kArray, kObject };
  struct Member;
  using Array = std::vector<Value>;
  using Object = std::vector<Member>;

  /// Null, of no place.
  Value() = default;

  /// The content of a value. An integer that fits 64 signed bits is `kInt`; `kUint` holds only what
  /// is larger, so that equal numbers have equal types.
  using Content = std::variant<std::monostate, bool, std::int64_t, std::uint64_t, double,
                               std::string, Array, Object>;

  /// The place to assign to a value.
  struct Origin {
    std::shared_ptr<const Source> source;
    int line = 0;
    std::string pointer;
  };

  Value(Content content, Origin origin);

  /// An empty object with the place of `place_of`.
  [[nodiscard]] static Value object_at(const Value& place_of);
  /// A string with the place of `place_of`.
  [[nodiscard]] static Value string_at(const Value& place_of, std::string text);

  [[nodiscard]] Type type() const;
  [[nodiscard]] const Content& content() const { return content_; }
  [[nodiscard]] bool is_null() const { return type() == Type::kNull; }
  [[nodiscard]] bool is_bool() const { return type() == Type::kBool; }
  [[nodiscard]] bool is_integer() const { return type() == Type::kInt || type() == Type::kUint; }
  [[nodiscard]] bool is_number() const { return is_integer() || type() == Type::kDouble; }
  [[nodiscard]] bool is_string() const { return type() == Type::kString; }
  [[nodiscard]] bool is_array() const { return type() == Type::kArray; }
  [[nodiscard]] bool is_object() const { return type() == Type::kObject; }

  /// @pre  the value is of that type (`as_int64`: and is `kInt`; `as_uint64`: and is not negative).
  [[nodiscard]] bool as_bool() const;
  [[nodiscard]] std::int64_t as_int64() const;
  [[nodiscard]] std::uint64_t as_uint64() const;
  [[nodiscard]] double as_double() const;  ///< Of any number.
  [[nodiscard]] const std::string& as_string() const;
  [[nodiscard]] const Array& items() const;
  [[nodiscard]] const Object& members() const;

  /// The string as a path. A relative one is relative to the folder of its file; to the working
  /// directory if it is from the command line. A string that begins with a variable, as
  /// `"${data}/town.osm"`, is relative to where that variable was assigned.
  ///
  /// @pre  `is_string()`
  [[nodiscard]] std::filesystem::path as_path() const;

  /// The member `key`; none if there is none, or if this is no object.
  [[nodiscard]] const Value* find(std::string_view key) const;
  /// The member at a dotted name such as `limits.jerk`, through nested objects.
  [[nodiscard]] const Value* find_dotted(std::string_view name) const;
  /// The item `index`. @pre `is_array()` and `index < size()`
  [[nodiscard]] const Value& operator[](std::size_t index) const { return items()[index]; }
  /// The member `key`. @pre it is there
  [[nodiscard]] const Value& operator[](std::string_view key) const;
  /// Number of items or members; 0 for values that are neither array nor object.
  [[nodiscard]] std::size_t size() const;

  /// Changing the tree. @pre `is_object()`, or for the items `is_array()`
  [[nodiscard]] Value* find(std::string_view key);
  void set(std::string_view key, Value value);  ///< Replaces the member, or appends it.
  bool erase(std::string_view key);             ///< Whether there was such a member.
  [[nodiscard]] Array& items();
  [[nodiscard]] Object& members();

  [[nodiscard]] Place place() const;
  [[nodiscard]] Origin origin() const { return {source_, line_, pointer_}; }
  [[nodiscard]] const std::shared_ptr<const Source>& source() const { return source_; }
  [[nodiscard]] const std::string& pointer() const { return pointer_; }
  /// Makes relative paths of this string relative to `base` instead of to its own file.
  void set_path_base(std::shared_ptr<const Source> base) { path_base_ = std::move(base); }
  [[nodiscard]] const std::shared_ptr<const Source>& path_base() const { return path_base_; }

  [[nodiscard]] nlohmann::json to_json() const;
  /// Compact JSON, `{"a":[1,2.5]}`.
  [[nodiscard]] std::string to_text() const;

  /// Whether the content is equal, ignoring places.
  [[nodiscard]] bool same_content(const Value& other) const;

 private:
  Content content_;
  std::shared_ptr<const Source> source_;
  std::shared_ptr<const Source> path_base_;  // Null: `source_`.
  int line_ = 0;
  std::string pointer_;
};

/// One `"key": value` of an object.
struct Value::Member {
  std::string key;
  Value value;
};

/// The value for a message: compact, cut after some 60 characters, with no control characters.
[[nodiscard]] std::string shown(const Value& value);
/// `text` in double quotes, escaped and cut in the same way.
[[nodiscard]] std::string in_quotes(std::string_view text, std::size_t max_length = 60);
/// `pointer` with one more reference token, escaped as RFC 6901 wants it.
[[nodiscard]] std::string pointer_to(std::string_view pointer, std::string_view token);

}  // namespace fastcycle::config
