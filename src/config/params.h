#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// The range of a number, both ends included; unset: no limit.
template <typename T>
struct Range {
  std::optional<T> min{};
  std::optional<T> max{};
};

/// The limits of a vector and its items.
template <typename T>
struct VectorRange {
  Range<T> item{};
  Range<std::size_t> size{};
};

/// Conversions. A mismatch is added to `problems`, and nothing is returned: the caller continues
/// with its fallback, so that one run finds all errors. `2.0` is no integer, but a double may be
/// written `2`.
[[nodiscard]] std::optional<bool> to_bool(const Value& value, Problems& problems);
[[nodiscard]] std::optional<std::int64_t> to_int64(const Value& value, const Range<std::int64_t>& r,
                                                   Problems& problems);
[[nodiscard]] std::optional<std::uint64_t> to_uint64(const Value& value,
                                                     const Range<std::uint64_t>& r,
                                                     Problems& problems);
[[nodiscard]] std::optional<double> to_double(const Value& value, const Range<double>& r,
                                              Problems& problems);
[[nodiscard]] std::optional<std::string> to_text(const Value& value, Problems& problems);
/// The index in `names` of the word that the value is.
[[nodiscard]] std::optional<std::size_t> to_choice(const Value& value,
                                                   std::span<const std::string> names,
                                                   Problems& problems);
[[nodiscard]] std::optional<std::vector<bool>> to_bools(const Value& value,
                                                        const Range<std::size_t>& size,
                                                        Problems& problems);
[[nodiscard]] std::optional<std::vector<std::int64_t>> to_int64s(
    const Value& value, const VectorRange<std::int64_t>& range, Problems& problems);
[[nodiscard]] std::optional<std::vector<std::uint64_t>> to_uint64s(
    const Value& value, const VectorRange<std::uint64_t>& range, Problems& problems);
[[nodiscard]] std::optional<std::vector<double>> to_doubles(const Value& value,
                                                            const VectorRange<double>& range,
                                                            Problems& problems);
[[nodiscard]] std::optional<std::vector<std::string>> to_texts(const Value& value,
                                                               const Range<std::size_t>& size,
                                                               Problems& problems);

/// Reads the params of one component, and reports those that were not read.
///
///     ParamReader reader(component.params, application.shared_params, problems);
///     const double limit = reader.read_double("limit_mps", 13.9, {.min = 0.0, .max = 60.0});
///     reader.finish();
///
/// A name is looked up in the component's own params, then in the shared ones; dots reach into
/// nested objects: `limits.jerk`.
///
/// @threads  Confined to the thread that constructs the component.
class ParamReader {
 public:
  /// All three are only borrowed, and must outlive the reader.
  ParamReader(const Value& params, const Value& shared, Problems& problems);

  /// The value, if the configuration has one. Declares the name; with an object, all below it too.
  [[nodiscard]] const Value* find(std::string_view name);
  /// As `find`; a missing value is an error.
  [[nodiscard]] const Value* require(std::string_view name);

  [[nodiscard]] bool read_bool(std::string_view name, bool fallback);
  [[nodiscard]] std::int64_t read_int64(std::string_view name, std::int64_t fallback,
                                        const Range<std::int64_t>& range = {});
  [[nodiscard]] std::uint64_t read_uint64(std::string_view name, std::uint64_t fallback,
                                          const Range<std::uint64_t>& range = {});
  [[nodiscard]] double read_double(std::string_view name, double fallback,
                                   const Range<double>& range = {});
  [[nodiscard]] std::string read_text(std::string_view name, std::string fallback);
  /// A string as a path, see `Value::as_path`. The fallback is taken as it is.
  [[nodiscard]] std::filesystem::path read_path(std::string_view name,
                                                std::filesystem::path fallback);
  /// The index in `names`.
  [[nodiscard]] std::size_t read_choice(std::string_view name, std::size_t fallback,
                                        std::span<const std::string> names);

  /// Adds an error for each param of the component that was not declared. `check_shared` checks
  /// shared params, once all components are known.
  void finish();

  /// The names requested so far.
  [[nodiscard]] const std::set<std::string>& declared() const { return declared_; }

 private:
  const Value& params_;
  const Value& shared_;
  Problems& problems_;
  std::set<std::string> declared_;
};

/// Adds an error for each shared param that no component declared. `declared` is the union over the
/// readers of all components.
void check_shared(const Value& shared, const std::set<std::string>& declared, Problems& problems);

}  // namespace fastcycle::config
