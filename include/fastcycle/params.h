#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "fastcycle/message.h"

namespace fastcycle {

/// A parameter that names a file or folder. A relative one is resolved against the folder of the
/// file in which its value stands, or the working folder if it came from the command line.
using Path = std::filesystem::path;

/// What may be the type of a parameter, beside enumerations and messages.
template <typename T>
concept ParamScalar = std::same_as<T, bool> || std::integral<T> || std::floating_point<T> ||
                      std::same_as<T, std::string> || std::same_as<T, Path>;

template <typename T>
struct IsParamVector : std::false_type {};
template <typename T>
struct IsParamVector<std::vector<T>> : std::bool_constant<ParamScalar<T> || std::is_enum_v<T>> {};

template <typename T>
concept ParamType = ParamScalar<T> || std::is_enum_v<T> || IsParamVector<T>::value || Message<T>;

namespace detail {

template <typename T>
struct ParamElement {
  using Type = T;
};
template <typename T>
struct ParamElement<std::vector<T>> {
  using Type = T;
};

}  // namespace detail

/// What a component says of one of its parameters. Without a `fallback` a value must be configured.
template <typename T>
struct ParamOptions {
  using Element = typename detail::ParamElement<T>::Type;

  std::optional<T> fallback = {};
  std::optional<Element> min = {};  ///< For numbers, and for each number of a vector; included.
  std::optional<Element> max = {};
  std::string unit = {};
  std::string description = {};
};

/// The same for enumerations: the names that the application file may use.
template <typename T>
  requires std::is_enum_v<typename detail::ParamElement<T>::Type>
struct ParamOptions<T> {
  using Element = typename detail::ParamElement<T>::Type;

  std::optional<T> fallback = {};
  std::vector<std::pair<std::string, Element>> names = {};
  std::string description = {};
};

/// A component's setting: read from the application file, checked, constant while the component
/// lives.
///
/// @threads  Compatible.
template <ParamType T>
class Param {
 public:
  explicit Param(T value) : value_(std::move(value)) {}

  [[nodiscard]] const T& get() const& noexcept { return value_; }
  /// Of a parameter that is not kept, its value.
  [[nodiscard]] T get() && { return std::move(value_); }

 private:
  T value_;
};

}  // namespace fastcycle
