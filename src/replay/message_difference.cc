#include "replay/message_difference.h"

#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>
#include <google/protobuf/util/field_comparator.h>
#include <google/protobuf/util/message_differencer.h>

namespace fastcycle::host {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::TextFormat;
using google::protobuf::util::MessageDifferencer;

constexpr const char* kMissing = "missing";
constexpr std::size_t kLongest = 120;  // Of a value in words.

std::string shortened(std::string text) {
  if (text.size() > kLongest) {
    text.resize(kLongest);
    text += "…";
  }
  return text;
}

/// The value of `field`; of a repeated one the element `index`.
std::string value_in_words(const Message& message, const FieldDescriptor& field, int index) {
  const auto& reflection = *message.GetReflection();
  const auto get = [&](auto single, auto repeated) {
    return index < 0 ? (reflection.*single)(message, &field)
                     : (reflection.*repeated)(message, &field, index);
  };
  using R = google::protobuf::Reflection;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return fmt::format("{}", get(&R::GetDouble, &R::GetRepeatedDouble));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return fmt::format("{}", get(&R::GetFloat, &R::GetRepeatedFloat));
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string text = get(&R::GetString, &R::GetRepeatedString);
      return field.type() == FieldDescriptor::TYPE_BYTES ? fmt::format("{} bytes", text.size())
                                                         : shortened("\"" + text + "\"");
    }
    case FieldDescriptor::CPPTYPE_MESSAGE: {
      const Message& inner = index < 0 ? reflection.GetMessage(message, &field)
                                       : reflection.GetRepeatedMessage(message, &field, index);
      return shortened("{" + inner.ShortDebugString() + "}");
    }
    default: {
      std::string text;
      TextFormat::PrintFieldValueToString(message, &field, index, &text);
      return shortened(text);
    }
  }
}

/// Keeps what is reported first.
class First final : public MessageDifferencer::Reporter {
 public:
  std::optional<FieldDifference> found;

  void ReportAdded(const Message&, const Message& now,
                   const std::vector<MessageDifferencer::SpecificField>& path) override {
    keep(path, nullptr, &now);
  }
  void ReportDeleted(const Message& recorded, const Message&,
                     const std::vector<MessageDifferencer::SpecificField>& path) override {
    keep(path, &recorded, nullptr);
  }
  void ReportModified(const Message& recorded, const Message& now,
                      const std::vector<MessageDifferencer::SpecificField>& path) override {
    keep(path, &recorded, &now);
  }

 private:
  using Path = std::vector<MessageDifferencer::SpecificField>;

  static std::string in_words(const Path& path) {
    std::string text;
    for (const auto& step : path) {
      text += text.empty() ? "" : ".";
      text += step.field == nullptr ? "(unknown)" : step.field->name();
      if (step.index >= 0) {
        text += fmt::format("[{}]", step.index);
      }
    }
    return text;
  }

  /// The last field of `path`, of the message that has it.
  static std::string value_in(const Message* message, const Path& path, bool is_new) {
    const auto& step = path.back();
    if (message == nullptr) {
      return kMissing;
    }
    if (step.field == nullptr) {
      return "an unknown field";
    }
    if (!step.field->is_repeated()) {
      return value_in_words(*message, *step.field, -1);
    }
    const int index = is_new ? step.new_index : step.index;
    return index >= 0 && index < message->GetReflection()->FieldSize(*message, step.field)
               ? value_in_words(*message, *step.field, index)
               : kMissing;
  }

  void keep(const Path& path, const Message* recorded, const Message* now) {
    if (!found) {
      found = {.field = in_words(path),
               .recorded = value_in(recorded, path, false),
               .now = value_in(now, path, true)};
    }
  }
};

}  // namespace

std::optional<FieldDifference> first_difference(const Message& recorded, const Message& now) {
  google::protobuf::util::DefaultFieldComparator comparator;
  comparator.set_float_comparison(google::protobuf::util::DefaultFieldComparator::EXACT);
  comparator.set_treat_nan_as_equal(true);
  First first;
  MessageDifferencer differencer;
  differencer.set_field_comparator(&comparator);
  differencer.ReportDifferencesTo(&first);
  static_cast<void>(differencer.Compare(recorded, now));
  return first.found;
}

}  // namespace fastcycle::host
