#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "config/value.h"

namespace fastcycle::config {

/// One error (or warning) of a configuration.
struct Problem {
  Place place;
  std::string message;   ///< The full sentence, without place and hint.
  std::string expected;  ///< The expected value, `a number in [0, 60]`; may be empty.
  std::string found;     ///< The actual value, `"fast"`; may be empty.
  std::string hint;      ///< A possible fix, `did you mean "limit_mps"?`; may be empty.
  bool warning = false;  ///< A warning is shown, but the application may start.
};

/// `file:line: /pointer: expected …, found …; did you mean "…"?`, on one line.
[[nodiscard]] std::string to_string(const Problem& problem);

/// The usual error: another value was expected. The message is composed from the two.
[[nodiscard]] Problem unexpected(const Value& at, std::string expected, std::string found,
                                 std::string hint = {});
/// The same, with the value itself as `found`.
[[nodiscard]] Problem unexpected(const Value& at, std::string expected);
/// An error that is one sentence.
[[nodiscard]] Problem make_error(Place place, std::string message, std::string hint = {});

/// `did you mean "name"?`, or nothing if `name` is empty.
[[nodiscard]] std::string did_you_mean(std::string_view name);

/// Collects all errors, so that one run reports everything.
///
/// Keeps at most `kMaxKept` errors and as many warnings: a file full of errors must not fill the
/// memory, and warnings must not hide an error.
///
/// @threads  Confined to the thread that loads the configuration.
class Problems {
 public:
  static constexpr std::size_t kMaxKept = 1000;

  void add(Problem problem);

  [[nodiscard]] bool has_errors() const { return error_count_ > 0; }
  [[nodiscard]] std::size_t error_count() const { return error_count_; }
  /// Whether one more will be kept; if not, its text need not be composed.
  [[nodiscard]] bool keeps_errors() const { return error_count_ < kMaxKept; }
  [[nodiscard]] bool keeps_warnings() const { return warning_count_ < kMaxKept; }
  [[nodiscard]] bool is_empty() const { return problems_.empty(); }

  /// Sorted by file and line, each one once.
  [[nodiscard]] std::vector<Problem> all() const;

 private:
  std::vector<Problem> problems_;
  std::size_t error_count_ = 0;
  std::size_t warning_count_ = 0;
};

}  // namespace fastcycle::config
