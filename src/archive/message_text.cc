#include "archive/message_text.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/util/json_util.h>

namespace fastcycle::archive {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

constexpr int kIndent = 2;

const std::string& text_in(const pb::Message& message, const Field& field, int index,
                           std::string& memory) {
  const pb::Reflection& reflection = *message.GetReflection();
  return index < 0 ? reflection.GetStringReference(message, &field, &memory)
                   : reflection.GetRepeatedStringReference(message, &field, index, &memory);
}

std::string enum_text(const pb::EnumDescriptor& type, int number) {
  const pb::EnumValueDescriptor* const value = type.FindValueByNumber(number);
  return value == nullptr ? fmt::format("{}", number) : value->name();
}

const pb::Message& message_in(const pb::Message& message, const Field& field, int index) {
  const pb::Reflection& reflection = *message.GetReflection();
  return index < 0 ? reflection.GetMessage(message, &field)
                   : reflection.GetRepeatedMessage(message, &field, index);
}

std::string more(std::uint64_t count) {
  return fmt::format("… {} more", count);
}

/// The first letters of a text; not in the middle of one.
std::string_view first_of(std::string_view text, std::size_t bytes) {
  bytes = std::min(bytes, text.size());
  while (bytes > 0 && bytes < text.size() &&
         (static_cast<unsigned char>(text[bytes]) & 0xC0U) == 0x80U) {
    --bytes;
  }
  return text.substr(0, bytes);
}

/// The parts of each field that are missing already.
using Cut = std::map<std::string, std::uint64_t, std::less<>>;

Cut by_field(const std::vector<Elided>& cut) {
  Cut result;
  for (const Elided& elided : cut) {
    result[elided.field] += elided.left_out;
  }
  return result;
}

std::uint64_t missing(const Cut& cut, const std::string& field) {
  const auto found = cut.find(field);
  return found == cut.end() ? 0 : found->second;
}

std::string path_to(const std::string& path, const Field& field) {
  return path.empty() ? field.name() : path + "." + field.name();
}

/// Writes a message as text.
class TextWriter {
 public:
  TextWriter(const TextLimits& limits, Cut cut) : limits_(limits), cut_(std::move(cut)) {}

  void write(const pb::Message& message, const std::string& path, int indent) {
    std::vector<const Field*> fields;
    message.GetReflection()->ListFields(message, &fields);
    for (const Field* field : fields) {
      if (field->is_repeated()) {
        write_repeated(message, *field, path_to(path, *field), indent);
      } else {
        write_one(message, *field, -1, path_to(path, *field), indent);
      }
    }
  }

  std::string take() { return std::move(text_); }

 private:
  void write_repeated(const pb::Message& message, const Field& field, const std::string& path,
                      int indent) {
    const int size = message.GetReflection()->FieldSize(message, &field);
    const int shown =
        static_cast<int>(std::min<std::size_t>(limits_.elements, static_cast<std::size_t>(size)));
    const auto left_out = static_cast<std::uint64_t>(size - shown) + missing(cut_, path);
    const auto place = [&](int i) { return fmt::format("{}[{}]", path, i); };
    if (field.cpp_type() == Field::CPPTYPE_MESSAGE) {
      for (int i = 0; i < shown; ++i) {
        write_one(message, field, i, place(i), indent);
      }
      if (left_out > 0) {
        line(indent, fmt::format("{}: [{}]", field.name(), more(left_out)));
      }
      return;
    }
    const bool is_text = field.cpp_type() == Field::CPPTYPE_STRING;
    std::string list;
    for (int i = 0; i < shown; ++i) {
      list += (i == 0 ? "" : ", ") + value(message, field, i, is_text ? place(i) : path);
    }
    if (left_out > 0) {
      list += (shown == 0 ? "" : ", ") + more(left_out);
    }
    line(indent, fmt::format("{}: [{}]", field.name(), list));
  }

  void write_one(const pb::Message& message, const Field& field, int index, const std::string& path,
                 int indent) {
    if (field.cpp_type() != Field::CPPTYPE_MESSAGE) {
      line(indent, field.name() + ": " + value(message, field, index, path));
      return;
    }
    line(indent, field.name() + " {");
    write(message_in(message, field, index), path, indent + kIndent);
    line(indent, "}");
  }

  [[nodiscard]] std::string value(const pb::Message& message, const Field& field, int index,
                                  const std::string& path) const {
    if (field.cpp_type() != Field::CPPTYPE_STRING) {
      return scalar_text(message, field, index);
    }
    std::string memory;
    const std::string& text = text_in(message, field, index, memory);
    const std::uint64_t cut = missing(cut_, path);
    if (field.type() == Field::TYPE_BYTES) {
      return text.size() > limits_.bytes || cut > 0 ? fmt::format("<{} bytes>", text.size() + cut)
                                                    : to_hex(mcap::bytes_of(text), limits_);
    }
    const std::string_view shown = first_of(text, limits_.letters);
    const std::uint64_t left_out = text.size() - shown.size() + cut;
    return "\"" + printable(shown) + "\"" + (left_out > 0 ? more(left_out) : "");
  }

  void line(int indent, const std::string& text) {
    text_.append(static_cast<std::size_t>(indent), ' ').append(text) += '\n';
  }

  const TextLimits& limits_;
  const Cut cut_;
  std::string text_;
};

/// Takes out of a message what is beyond the limits.
class Elider {
 public:
  Elider(const TextLimits& limits, Cut cut, std::vector<Elided>& elided)
      : limits_(limits), cut_(std::move(cut)), elided_(elided) {}

  void shorten(pb::Message& message, const std::string& path) {
    std::vector<const Field*> fields;
    message.GetReflection()->ListFields(message, &fields);
    for (const Field* field : fields) {
      const std::string name = path_to(path, *field);
      if (field->is_repeated()) {
        shorten_list(message, *field, name);
      } else {
        shorten_one(message, *field, -1, name);
      }
    }
  }

 private:
  void shorten_list(pb::Message& message, const Field& field, const std::string& name) {
    const pb::Reflection& reflection = *message.GetReflection();
    const int size = reflection.FieldSize(message, &field);
    const auto most =
        static_cast<int>(std::min<std::size_t>(limits_.elements, std::numeric_limits<int>::max()));
    for (int i = size; i > most; --i) {
      reflection.RemoveLast(&message, &field);
    }
    const std::uint64_t left_out =
        static_cast<std::uint64_t>(std::max(size - most, 0)) + missing(cut_, name);
    if (left_out > 0) {
      elided_.push_back({.field = name, .left_out = left_out});
    }
    for (int i = 0; i < std::min(size, most); ++i) {
      shorten_one(message, field, i, fmt::format("{}[{}]", name, i));
    }
  }

  void shorten_one(pb::Message& message, const Field& field, int index, const std::string& name) {
    const pb::Reflection& reflection = *message.GetReflection();
    if (field.cpp_type() == Field::CPPTYPE_MESSAGE) {
      shorten(index < 0 ? *reflection.MutableMessage(&message, &field)
                        : *reflection.MutableRepeatedMessage(&message, &field, index),
              name);
      return;
    }
    if (field.cpp_type() != Field::CPPTYPE_STRING) {
      return;
    }
    std::string memory;
    const std::string& text = text_in(message, field, index, memory);
    const bool is_bytes = field.type() == Field::TYPE_BYTES;
    const std::uint64_t cut = missing(cut_, name);
    if (text.size() <= (is_bytes ? limits_.bytes : limits_.letters) && cut == 0) {
      return;
    }
    std::string kept = is_bytes ? std::string() : std::string(first_of(text, limits_.letters));
    elided_.push_back({.field = name, .left_out = text.size() - kept.size() + cut});
    if (index < 0) {
      reflection.SetString(&message, &field, std::move(kept));
    } else {
      reflection.SetRepeatedString(&message, &field, index, std::move(kept));
    }
  }

  const TextLimits& limits_;
  const Cut cut_;
  std::vector<Elided>& elided_;
};

}  // namespace

TextLimits TextLimits::none() {
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  return {.elements = kAll, .bytes = kAll, .letters = kAll};
}

std::string scalar_text(const pb::Message& message, const Field& field, int index) {
  const pb::Reflection& reflection = *message.GetReflection();
  const auto number = [&](auto one, auto element) {
    return fmt::format("{}", index < 0 ? (reflection.*one)(message, &field)
                                       : (reflection.*element)(message, &field, index));
  };
  using Reflection = pb::Reflection;
  switch (field.cpp_type()) {
    case Field::CPPTYPE_INT32:
      return number(&Reflection::GetInt32, &Reflection::GetRepeatedInt32);
    case Field::CPPTYPE_INT64:
      return number(&Reflection::GetInt64, &Reflection::GetRepeatedInt64);
    case Field::CPPTYPE_UINT32:
      return number(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32);
    case Field::CPPTYPE_UINT64:
      return number(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64);
    case Field::CPPTYPE_DOUBLE:
      return number(&Reflection::GetDouble, &Reflection::GetRepeatedDouble);
    case Field::CPPTYPE_FLOAT:
      return number(&Reflection::GetFloat, &Reflection::GetRepeatedFloat);
    case Field::CPPTYPE_BOOL:
      return number(&Reflection::GetBool, &Reflection::GetRepeatedBool);
    case Field::CPPTYPE_ENUM:
      return enum_text(*field.enum_type(),
                       index < 0 ? reflection.GetEnumValue(message, &field)
                                 : reflection.GetRepeatedEnumValue(message, &field, index));
    case Field::CPPTYPE_STRING: {
      std::string memory;
      const std::string& text = text_in(message, field, index, memory);
      return field.type() == Field::TYPE_BYTES ? fmt::format("<{} bytes>", text.size()) : text;
    }
    case Field::CPPTYPE_MESSAGE:
      break;
  }
  throw std::logic_error("a message is no scalar");
}

std::string to_text(const pb::Message& message, const TextLimits& limits, int indent,
                    const std::vector<Elided>& cut) {
  TextWriter writer(limits, by_field(cut));
  writer.write(message, "", indent);
  return writer.take();
}

MessageJson to_json(const pb::Message& message, const TextLimits& limits,
                    const std::vector<Elided>& cut) {
  MessageJson result;
  const std::unique_ptr<pb::Message> shortened(message.New());
  shortened->CopyFrom(message);
  Elider(limits, by_field(cut), result.elided).shorten(*shortened, "");
  pb::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  const auto status = pb::util::MessageToJsonString(*shortened, &result.data, options);
  if (!status.ok()) {
    throw std::runtime_error("no JSON can be made of it: " + status.ToString());
  }
  return result;
}

std::string to_hex(mcap::Bytes bytes, const TextLimits& limits) {
  const mcap::Bytes shown = bytes.first(std::min(bytes.size(), limits.bytes));
  std::string text;
  text.reserve(2 * shown.size());
  for (const std::byte byte : shown) {
    text += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
  }
  return shown.size() < bytes.size() ? text + more(bytes.size() - shown.size()) : text;
}

}  // namespace fastcycle::archive
