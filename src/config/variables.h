#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// The variables of one file: the values of `${name}` in its strings.
///
/// A file declares its variables with their defaults; the command line, an overlay or the including
/// file may give other values. So first `declare`, then `give`, then `complete`, then `substitute`.
///
/// @threads  Confined to the thread that loads the configuration.
class Variables {
 public:
  /// Limit for the growth of all strings of one file: a variable may be large and used often.
  static constexpr std::size_t kMaxInsertedBytes = std::size_t{16} << 20U;

  /// Declares the members of a file's `"variables"`. Null declares one without a default.
  void declare(const Value& variables);

  /// Takes the members of `values`, whose names have to be declared, and whose types have to be
  /// those of the defaults.
  void give(const Value& values, Problems& problems);

  /// Takes `name=value` from the command line. The value is text where the default is; otherwise
  /// JSON where it can be read as such.
  void give_option(const std::string& option, Problems& problems);

  /// Replaces variables in the defaults, each of which may use those declared before it. Adds an
  /// error for each variable without a value.
  void complete(Problems& problems);

  /// Replaces the variables in all strings of `value`, but not in its keys. A string that is
  /// nothing but `${name}` becomes the variable's value with its type. `$${` stands for `${`.
  void substitute(Value& value, Problems& problems);

 private:
  struct Variable {
    std::string name;
    Value declared;
    Value value;
    bool is_given = false;  // Has a value, be it the default.
  };

  Variable* find_declared(std::string_view name, const Place& place, Problems& problems);
  void give_one(std::string_view name, Value value, Problems& problems);
  Value substitute_text(const Value& value, Problems& problems);
  [[nodiscard]] bool count_inserted(std::size_t bytes, const Place& place, Problems& problems);
  [[nodiscard]] std::vector<std::string> names() const;

  std::vector<Variable> variables_;  // In the order of their declaration.
  std::map<std::string, std::size_t, std::less<>> index_of_;
  std::size_t usable_count_ = 0;  // Only the first of them may be used in strings.
  std::size_t inserted_bytes_ = 0;
};

/// Escapes `text` for `substitute`: `${` becomes `$${`.
[[nodiscard]] std::string escape_variables(const std::string& text);

}  // namespace fastcycle::config
