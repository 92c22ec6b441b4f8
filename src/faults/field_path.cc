#include "faults/field_path.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include <google/protobuf/descriptor.h>

namespace fastcycle::faults {
namespace {

using config::Corruption;
using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

bool is_floating(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE ||
         field.cpp_type() == FieldDescriptor::CPPTYPE_FLOAT;
}

bool is_text(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_STRING;
}

bool is_message(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
}

/// Why `field` cannot be corrupted so; empty if it can.
std::string objection(const FieldDescriptor& field, Corruption corruption) {
  if (field.is_map()) {
    return "it is a map";
  }
  switch (corruption) {
    case Corruption::kNan:
      return is_floating(field) ? "" : "only a double or a float can be \"nan\"";
    case Corruption::kValue:
      return is_text(field) || is_message(field) ? "only a number can become a \"value\"" : "";
    case Corruption::kBitFlip:
      return is_message(field) ? "it is a message: name one of its fields" : "";
    case Corruption::kStale:
      return "";
  }
  return "";
}

template <typename Number>
Number converted(double value) {
  if constexpr (std::is_same_v<Number, bool>) {
    return value != 0;
  } else if constexpr (std::is_floating_point_v<Number>) {
    return static_cast<Number>(value);
  } else {
    // Beyond what it can hold, the nearest that it can.
    if (std::isnan(value)) {
      return 0;
    }
    if (value <= static_cast<double>(std::numeric_limits<Number>::min())) {
      return std::numeric_limits<Number>::min();
    }
    if (value >= static_cast<double>(std::numeric_limits<Number>::max())) {
      return std::numeric_limits<Number>::max();
    }
    return static_cast<Number>(value);
  }
}

template <typename Number>
Number flipped(Number number, std::uint64_t bits) {
  if constexpr (std::is_same_v<Number, bool>) {
    return !number;
  } else if constexpr (sizeof(Number) == 8) {
    return std::bit_cast<Number>(std::bit_cast<std::uint64_t>(number) ^
                                 (std::uint64_t{1} << (bits % 64)));
  } else {
    return std::bit_cast<Number>(std::bit_cast<std::uint32_t>(number) ^
                                 (std::uint32_t{1} << (bits % 32)));
  }
}

/// A change of a field.
struct Change {
  Corruption corruption;
  double value;
  std::uint64_t bits;
};

template <typename Number>
Number changed(Number number, const Change& change) {
  switch (change.corruption) {
    case Corruption::kNan:
      return converted<Number>(std::numeric_limits<double>::quiet_NaN());
    case Corruption::kValue:
      return converted<Number>(change.value);
    case Corruption::kBitFlip:
      return flipped(number, change.bits);
    case Corruption::kStale:
      break;
  }
  return number;
}

std::string changed_text(std::string text, const Change& change) {
  if (!text.empty() && change.corruption == Corruption::kBitFlip) {
    char& byte = text[(change.bits / 8) % text.size()];
    byte = static_cast<char>(static_cast<unsigned char>(byte) ^ (1U << (change.bits % 8)));
  }
  return text;
}

/// Changes one value of `field`; `index` is -1 where it is not repeated.
void change_one(Message& message, const FieldDescriptor* field, int index, const Change& change) {
  const Reflection& its = *message.GetReflection();
  const auto apply = [&](auto get, auto get_one, auto set, auto set_one) {
    if (index < 0) {
      (its.*set)(&message, field, changed((its.*get)(message, field), change));
    } else {
      (its.*set_one)(&message, field, index,
                     changed((its.*get_one)(message, field, index), change));
    }
  };
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return apply(&Reflection::GetDouble, &Reflection::GetRepeatedDouble, &Reflection::SetDouble,
                   &Reflection::SetRepeatedDouble);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return apply(&Reflection::GetFloat, &Reflection::GetRepeatedFloat, &Reflection::SetFloat,
                   &Reflection::SetRepeatedFloat);
    case FieldDescriptor::CPPTYPE_INT32:
      return apply(&Reflection::GetInt32, &Reflection::GetRepeatedInt32, &Reflection::SetInt32,
                   &Reflection::SetRepeatedInt32);
    case FieldDescriptor::CPPTYPE_INT64:
      return apply(&Reflection::GetInt64, &Reflection::GetRepeatedInt64, &Reflection::SetInt64,
                   &Reflection::SetRepeatedInt64);
    case FieldDescriptor::CPPTYPE_UINT32:
      return apply(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32, &Reflection::SetUInt32,
                   &Reflection::SetRepeatedUInt32);
    case FieldDescriptor::CPPTYPE_UINT64:
      return apply(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64, &Reflection::SetUInt64,
                   &Reflection::SetRepeatedUInt64);
    case FieldDescriptor::CPPTYPE_BOOL:
      return apply(&Reflection::GetBool, &Reflection::GetRepeatedBool, &Reflection::SetBool,
                   &Reflection::SetRepeatedBool);
    case FieldDescriptor::CPPTYPE_ENUM:
      return apply(&Reflection::GetEnumValue, &Reflection::GetRepeatedEnumValue,
                   &Reflection::SetEnumValue, &Reflection::SetRepeatedEnumValue);
    case FieldDescriptor::CPPTYPE_STRING:
      if (index < 0) {
        its.SetString(&message, field, changed_text(its.GetString(message, field), change));
      } else {
        its.SetRepeatedString(&message, field, index,
                              changed_text(its.GetRepeatedString(message, field, index), change));
      }
      return;
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return;
  }
}

/// Makes the top-level field of `message` what it is in `before`.
void take_over(Message& message, const Message& before, const FieldDescriptor* field) {
  const Reflection& its = *message.GetReflection();
  const std::unique_ptr<Message> old(before.New());
  old->CopyFrom(before);
  // Of a message that was copied, the field alone is exchanged; the rest stays.
  its.SwapFields(&message, old.get(), {field});
}

}  // namespace

std::optional<FieldPath> FieldPath::find(std::string_view text, const Descriptor& type,
                                         Corruption corruption, std::string& why) {
  FieldPath path;
  const Descriptor* at = &type;
  while (!text.empty()) {
    const std::string word(text.substr(0, text.find('.')));
    text.remove_prefix(std::min(word.size() + 1, text.size()));
    int index = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), index);
    if (error == std::errc() && end == word.data() + word.size()) {
      if (path.steps_.empty() || !path.steps_.back().field->is_repeated() ||
          path.steps_.back().index >= 0) {
        why = "\"" + word + "\" stands behind no repeated field";
        return std::nullopt;
      }
      path.steps_.back().index = index;
      continue;
    }
    const FieldDescriptor* field = at == nullptr ? nullptr : at->FindFieldByName(word);
    if (field == nullptr) {
      why = at == nullptr
                ? "\"" + word + "\" stands behind a field that is no message"
                : "the type " + std::string(at->full_name()) + " has no field \"" + word + "\"";
      return std::nullopt;
    }
    path.steps_.push_back({field, -1});
    at = field->is_map() ? nullptr : field->message_type();
  }
  if (path.steps_.empty()) {
    why = "it names no field";
    return std::nullopt;
  }
  why = objection(*path.steps_.back().field, corruption);
  return why.empty() ? std::optional(std::move(path)) : std::nullopt;
}

void FieldPath::corrupt(Message& message, Corruption corruption, double value, std::uint64_t bits,
                        const Message* before) const {
  const auto walk = [&](const auto& self, Message& at, const Message* old,
                        std::size_t depth) -> void {
    const auto& [field, index] = steps_[depth];
    const Reflection& its = *at.GetReflection();
    const bool is_last = depth + 1 == steps_.size();
    if (is_last && corruption == Corruption::kStale) {
      if (old != nullptr) {
        take_over(at, *old, field);
      }
      return;
    }
    if (!field->is_repeated()) {
      if (is_last) {
        change_one(at, field, -1, {corruption, value, bits});
      } else if (its.HasField(at, field)) {
        self(self, *its.MutableMessage(&at, field),
             old == nullptr ? nullptr : &its.GetMessage(*old, field), depth + 1);
      }
      return;
    }
    const int size = its.FieldSize(at, field);
    const int begin = index < 0 ? 0 : index;
    const int end = index < 0 ? size : std::min(size, index + 1);
    for (int i = begin; i < end; ++i) {
      if (is_last) {
        change_one(at, field, i, {corruption, value, bits});
      } else {
        const bool was_there = old != nullptr && i < its.FieldSize(*old, field);
        self(self, *its.MutableRepeatedMessage(&at, field, i),
             was_there ? &its.GetRepeatedMessage(*old, field, i) : nullptr, depth + 1);
      }
    }
  };
  walk(walk, message, before, 0);
}

}  // namespace fastcycle::faults
