#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <google/protobuf/message.h>

namespace fastcycle::detail {

/// One value of a parameter; a vector has several.
using ParamElementValue = std::variant<bool, std::int64_t, std::uint64_t, double, std::string>;

enum class ParamKind : std::uint8_t {
  kBool,
  kSigned,
  kUnsigned,
  kDouble,
  kString,
  kPath,
  kEnum,
  kMessage,
};

/// A parameter's value without its C++ type.
struct ParamData {
  std::vector<ParamElementValue> elements = {};  ///< Of an enumeration: indices into its names.
  std::shared_ptr<const google::protobuf::Message> message = {};  ///< Of a message; else null.
};

/// A parameter's declaration without its C++ type.
struct ParamSpec {
  std::string name = {};
  ParamKind kind = ParamKind::kBool;
  bool is_vector = false;
  bool is_tunable = false;
  std::optional<ParamData> fallback = {};
  std::optional<ParamElementValue> min = {};  ///< Integers always have both: those of their type.
  std::optional<ParamElementValue> max = {};
  bool has_own_min = false;  ///< Given by the author.
  bool has_own_max = false;
  std::vector<std::string> names = {};                   ///< Of an enumeration.
  const google::protobuf::Message* prototype = nullptr;  ///< Of a message: an empty one.
  std::string unit = {};
  std::string description = {};
};

/// Storage for the value of one parameter. It lasts as long as the application: a value that was
/// changed at run time outlives the component's object.
///
/// @threads  `spec` is read under the application's lock on params; all else is confined to the
///           component's constructor and activations.
class ParamSlot {
 public:
  explicit ParamSlot(ParamSpec its_spec) : spec(std::move(its_spec)) {}
  ParamSlot(const ParamSlot&) = delete;
  ParamSlot& operator=(const ParamSlot&) = delete;
  virtual ~ParamSlot() = default;

  /// Stores a value, which was checked against `spec`.
  virtual void put(const ParamData& data) = 0;
  /// Takes over the new declaration of a restarted component. @pre `fresh` is of the same type.
  virtual void renew(ParamSlot& fresh) = 0;

  ParamSpec spec;
  /// Called when the value was changed; may be empty.
  std::function<void()> on_change;
};

}  // namespace fastcycle::detail
