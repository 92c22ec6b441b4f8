#include "ros2/type_hash.h"

#include <map>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ros2/sha256.h"

namespace fastcycle::ros2 {
namespace {

// The numbers of `type_description_interfaces/msg/FieldType`.
constexpr int kNested = 1;
constexpr int kBoundedTexts = 4;  // From STRING to BOUNDED_STRING.
constexpr int kArrays = 48;
constexpr int kBoundedSequences = 96;
constexpr int kSequences = 144;

int number_of(Kind kind) {
  switch (kind) {
    case Kind::kMessage:
      return kNested;
    case Kind::kInt8:
      return 2;
    case Kind::kUint8:
      return 3;
    case Kind::kInt16:
      return 4;
    case Kind::kUint16:
      return 5;
    case Kind::kInt32:
      return 6;
    case Kind::kUint32:
      return 7;
    case Kind::kInt64:
      return 8;
    case Kind::kUint64:
      return 9;
    case Kind::kFloat32:
      return 10;
    case Kind::kFloat64:
      return 11;
    case Kind::kBool:
      return 15;
    case Kind::kByte:
      return 16;
    case Kind::kText:
      return 17;
    case Kind::kWideText:
      return 18;
  }
  return 0;
}

int number_of(const Field& field) {
  const int one = number_of(field.kind) + (field.text_max > 0 ? kBoundedTexts : 0);
  switch (field.shape) {
    case Shape::kOne:
      return one;
    case Shape::kArray:
      return one + kArrays;
    case Shape::kBoundedSequence:
      return one + kBoundedSequences;
    case Shape::kSequence:
      return one + kSequences;
  }
  return one;
}

// Names consist of letters, digits, _ and /, so nothing needs to be escaped.
std::string describe(const Definition& definition) {
  std::vector<std::string> fields;
  for (const Field& field : definition.fields) {
    fields.push_back(fmt::format(R"({{"name": "{}", "type": {{"type_id": {}, "capacity": {}, )"
                                 R"("string_capacity": {}, "nested_type_name": "{}"}}}})",
                                 field.name, number_of(field), field.count, field.text_max,
                                 field.message == nullptr ? "" : field.message->name));
  }
  return fmt::format(R"({{"type_name": "{}", "fields": [{}]}})", definition.name,
                     fmt::join(fields, ", "));
}

void collect(const Definition& definition, std::map<std::string_view, const Definition*>& all) {
  for (const Field& field : definition.fields) {
    if (field.message != nullptr && all.emplace(field.message->name, field.message).second) {
      collect(*field.message, all);
    }
  }
}

}  // namespace

std::string type_description(const Definition& definition) {
  std::map<std::string_view, const Definition*> all;
  collect(definition, all);
  std::vector<std::string> referenced;
  for (const auto& [name, other] : all) {
    referenced.push_back(describe(*other));
  }
  return fmt::format(R"({{"type_description": {}, "referenced_type_descriptions": [{}]}})",
                     describe(definition), fmt::join(referenced, ", "));
}

std::string type_hash(const Definition& definition) {
  std::string text = "RIHS01_";
  for (const std::byte byte : sha256(type_description(definition))) {
    text += fmt::format("{:02x}", static_cast<unsigned>(byte));
  }
  return text;
}

}  // namespace fastcycle::ros2
