#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "fastcycle/detail/param_slot.h"
#include "fastcycle/message.h"

namespace fastcycle {

/// A parameter that names a file or folder. A relative one is resolved against the folder of the
/// file that contains its value, or the working directory if it is from the command line.
using Path = std::filesystem::path;

/// The scalar types of a parameter.
template <typename T>
concept ParamScalar = std::same_as<T, bool> || std::integral<T> || std::floating_point<T> ||
                      std::same_as<T, std::string> || std::same_as<T, Path>;

/// Whether `T` is a vector of parameter types.
template <typename T>
struct IsParamVector : std::false_type {};
template <typename T>
struct IsParamVector<std::vector<T>> : std::bool_constant<ParamScalar<T> || std::is_enum_v<T>> {};

/// The types of a parameter: a scalar, an enumeration, a vector of these, or a message.
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

/// Options of one parameter. Without a `fallback` a value must be configured.
template <typename T>
struct ParamOptions {
  /// `T`, or the element type of a vector `T`.
  using Element = typename detail::ParamElement<T>::Type;

  /// The value where none is configured.
  std::optional<T> fallback = {};
  std::optional<Element> min = {};  ///< For numbers, and for each number of a vector; included.
  /// The largest value; included.
  std::optional<Element> max = {};
  /// For people: "m/s".
  std::string unit = {};
  /// For people, in one sentence.
  std::string description = {};
  bool is_tunable = false;  ///< It may be changed while the component runs.
};

/// The same for enumerations: the names that the application file may use.
template <typename T>
  requires std::is_enum_v<typename detail::ParamElement<T>::Type>
struct ParamOptions<T> {
  /// The enumeration `T`, or the element type of a vector `T`.
  using Element = typename detail::ParamElement<T>::Type;

  /// The value where none is configured.
  std::optional<T> fallback = {};
  /// The name of each value.
  std::vector<std::pair<std::string, Element>> names = {};
  /// For people, in one sentence.
  std::string description = {};
  /// Whether it may be changed while the component runs.
  bool is_tunable = false;
};

namespace detail {

template <typename Element>
constexpr ParamKind kind_of() {
  if constexpr (std::same_as<Element, bool>) {
    return ParamKind::kBool;
  } else if constexpr (std::is_enum_v<Element>) {
    return ParamKind::kEnum;
  } else if constexpr (std::floating_point<Element>) {
    return ParamKind::kDouble;
  } else if constexpr (std::signed_integral<Element>) {
    return ParamKind::kSigned;
  } else if constexpr (std::unsigned_integral<Element>) {
    return ParamKind::kUnsigned;
  } else if constexpr (std::same_as<Element, Path>) {
    return ParamKind::kPath;
  } else if constexpr (Message<Element>) {
    return ParamKind::kMessage;
  } else {
    return ParamKind::kString;
  }
}

/// Converts between a parameter's C++ type and its type-erased values.
template <typename T>
struct ParamCodec {
  using Options = ParamOptions<T>;
  using Element = typename Options::Element;

  static constexpr ParamKind kKind = kind_of<Element>();
  static constexpr bool kIsVector = IsParamVector<T>::value;

  static ParamElementValue encode(const Element& value, const Options& options) {
    if constexpr (kKind == ParamKind::kEnum) {
      for (std::size_t index = 0; index < options.names.size(); ++index) {
        if (options.names[index].second == value) {
          return static_cast<std::int64_t>(index);
        }
      }
      return std::int64_t{-1};
    } else if constexpr (kKind == ParamKind::kDouble) {
      return static_cast<double>(value);
    } else if constexpr (kKind == ParamKind::kSigned) {
      return static_cast<std::int64_t>(value);
    } else if constexpr (kKind == ParamKind::kUnsigned) {
      return static_cast<std::uint64_t>(value);
    } else if constexpr (kKind == ParamKind::kPath) {
      return value.string();
    } else {
      return value;
    }
  }

  static Element decode(const ParamElementValue& value, const Options& options) {
    if constexpr (kKind == ParamKind::kEnum) {
      return options.names.at(static_cast<std::size_t>(std::get<std::int64_t>(value))).second;
    } else if constexpr (kKind == ParamKind::kDouble) {
      return static_cast<Element>(std::get<double>(value));
    } else if constexpr (kKind == ParamKind::kSigned) {
      return static_cast<Element>(std::get<std::int64_t>(value));
    } else if constexpr (kKind == ParamKind::kUnsigned) {
      return static_cast<Element>(std::get<std::uint64_t>(value));
    } else if constexpr (kKind == ParamKind::kPath) {
      return Path(std::get<std::string>(value));
    } else {
      return std::get<Element>(value);
    }
  }

  static ParamData encode_all(const T& value, const Options& options) {
    ParamData data;
    if constexpr (kKind == ParamKind::kMessage) {
      data.message = std::make_shared<T>(value);
    } else if constexpr (kIsVector) {
      for (const Element& element : value) {
        data.elements.push_back(encode(element, options));
      }
    } else {
      data.elements.push_back(encode(value, options));
    }
    return data;
  }

  static T decode_all(const ParamData& data, const Options& options) {
    if constexpr (kKind == ParamKind::kMessage) {
      return static_cast<const T&>(*data.message);
    } else if constexpr (kIsVector) {
      T result{};
      for (const ParamElementValue& value : data.elements) {
        result.push_back(decode(value, options));
      }
      return result;
    } else {
      return decode(data.elements.at(0), options);
    }
  }

  static ParamSpec spec(std::string_view name, const Options& options) {
    ParamSpec spec{.name = std::string(name),
                   .kind = kKind,
                   .is_vector = kIsVector,
                   .is_tunable = options.is_tunable,
                   .description = options.description};
    if constexpr (kKind == ParamKind::kMessage) {
      spec.prototype = &T::default_instance();
    } else if constexpr (kKind == ParamKind::kEnum) {
      for (const auto& [text, value] : options.names) {
        spec.names.push_back(text);
      }
    } else if constexpr (std::integral<Element> && kKind != ParamKind::kBool) {
      spec.min = encode(options.min.value_or(std::numeric_limits<Element>::min()), options);
      spec.max = encode(options.max.value_or(std::numeric_limits<Element>::max()), options);
    } else if constexpr (kKind == ParamKind::kDouble) {
      if (options.min) {
        spec.min = encode(*options.min, options);
      }
      if (options.max) {
        spec.max = encode(*options.max, options);
      }
    }
    if constexpr (kKind != ParamKind::kEnum) {
      spec.unit = options.unit;
      spec.has_own_min = options.min.has_value();
      spec.has_own_max = options.max.has_value();
    }
    if (options.fallback) {
      spec.fallback = encode_all(*options.fallback, options);
    }
    return spec;
  }
};

/// A slot with its value.
template <ParamType T>
class ParamSlotOf final : public ParamSlot {
 public:
  ParamSlotOf(std::string_view name, ParamOptions<T> options)
      : ParamSlot(ParamCodec<T>::spec(name, options)), options_(std::move(options)) {}

  void put(const ParamData& data) override { value_ = decode(data); }
  void renew(ParamSlot& fresh) override {
    options_ = std::move(static_cast<ParamSlotOf&>(fresh).options_);
    spec = std::move(fresh.spec);
    on_change = nullptr;
  }

  [[nodiscard]] const T& value() const noexcept { return value_; }
  [[nodiscard]] T decode(const ParamData& data) const {
    return ParamCodec<T>::decode_all(data, options_);
  }

 private:
  T value_{};
  ParamOptions<T> options_;
};

}  // namespace detail

/// A component's setting: read from the application file, checked, and constant within an
/// activation. One that `is_tunable` may be changed at run time: an activation of the component,
/// with the cause `parameter`, applies the new value.
///
/// A small handle: copies refer to the same value. References from `get` are valid as long as the
/// component.
///
/// @threads  Confined to its component: pass values to other threads and to offloaded work.
/// @realtime Reads memory: no lock, no allocation.
template <ParamType T>
class Param {
 public:
  /// Constructed by `Context::param`.
  explicit Param(const detail::ParamSlotOf<T>& slot) : slot_(&slot) {}

  /// The value; it does not change within an activation.
  [[nodiscard]] const T& get() const& noexcept { return slot_->value(); }
  /// The value of a temporary, as a copy.
  [[nodiscard]] T get() && { return slot_->value(); }

  /// For the library's own templates.
  [[nodiscard]] const detail::ParamSlotOf<T>& slot() const noexcept { return *slot_; }

 private:
  const detail::ParamSlotOf<T>* slot_;
};

/// One new value of a parameter.
struct ParamChange {
  /// The component's full name, a dot, and the parameter: "front/limiter.limits.jerk". With
  /// "shared_params" instead of the component: for all components that read the shared one.
  std::string param;
  /// As in the application file: `20`, `"city"`, `[1, 2]`, `{"jerk": 2}`.
  std::string json;
};

/// The result of a transaction: all of its changes were made, or none and there are errors.
struct ParamsResult {
  /// Each on one line: `limiter.limit_mps: expected a number in [0, 60], found "fast"`.
  std::vector<std::string> errors = {};

  /// Whether all changes were made.
  [[nodiscard]] bool has_changed() const noexcept { return errors.empty(); }
};

/// The values that a component's parameters would have after a transaction.
class ProposedParams {
 public:
  /// Returns the proposed value of a slot.
  using Find = std::function<const detail::ParamData&(const detail::ParamSlot&)>;

  /// Constructed by FastCycle, for one check.
  explicit ProposedParams(Find find) : find_(std::move(find)) {}

  /// The value that `param` would have.
  template <ParamType T>
  [[nodiscard]] T get(const Param<T>& param) const {
    return param.slot().decode(find_(param.slot()));
  }

 private:
  Find find_;
};

/// Returns why a component cannot accept the proposed values; empty if it can.
using ParamCheck = std::function<std::string(const ProposedParams&)>;

/// A value as `ParamChange::json`.
[[nodiscard]] std::string param_json(bool value);
[[nodiscard]] std::string param_json(double value);
[[nodiscard]] std::string param_json(const std::string& value);
[[nodiscard]] inline std::string param_json(const char* value) {
  return param_json(std::string(value));
}
template <std::integral T>
[[nodiscard]] std::string param_json(T value) {
  return std::to_string(value);
}

}  // namespace fastcycle
