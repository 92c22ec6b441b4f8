#include "replay/message_difference.h"

#include <cmath>
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
constexpr std::size_t kLongest = 120;  // Of a value as text.

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

/// The same as a number; none if it is not finite or no number.
std::optional<double> number(const Message& message, const FieldDescriptor& field, int index) {
  const auto& reflection = *message.GetReflection();
  const auto get = [&](auto single, auto repeated) {
    return static_cast<double>(index < 0 ? (reflection.*single)(message, &field)
                                         : (reflection.*repeated)(message, &field, index));
  };
  using R = google::protobuf::Reflection;
  double value = 0.0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      value = get(&R::GetDouble, &R::GetRepeatedDouble);
      break;
    case FieldDescriptor::CPPTYPE_FLOAT:
      value = get(&R::GetFloat, &R::GetRepeatedFloat);
      break;
    case FieldDescriptor::CPPTYPE_INT32:
      value = get(&R::GetInt32, &R::GetRepeatedInt32);
      break;
    case FieldDescriptor::CPPTYPE_INT64:
      value = get(&R::GetInt64, &R::GetRepeatedInt64);
      break;
    case FieldDescriptor::CPPTYPE_UINT32:
      value = get(&R::GetUInt32, &R::GetRepeatedUInt32);
      break;
    case FieldDescriptor::CPPTYPE_UINT64:
      value = get(&R::GetUInt64, &R::GetRepeatedUInt64);
      break;
    default:
      return std::nullopt;
  }
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

using Path = std::vector<MessageDifferencer::SpecificField>;

/// One difference as the differencer reports it.
class Reported final : public FieldDifference {
 public:
  Reported(const Path& path, const Message* recorded, const Message* now)
      : path_(path), recorded_(recorded), now_(now) {}

  [[nodiscard]] std::string path() const override { return to_text(true); }
  [[nodiscard]] std::string pattern() const override { return to_text(false); }
  [[nodiscard]] std::string recorded() const override { return value_in(recorded_, false); }
  [[nodiscard]] std::string now() const override { return value_in(now_, true); }

  [[nodiscard]] std::optional<double> change() const override {
    const auto& step = path_.back();
    if (recorded_ == nullptr || now_ == nullptr || step.field == nullptr) {
      return std::nullopt;
    }
    const std::optional<int> old_index = index_in(*recorded_, false);
    const std::optional<int> new_index = index_in(*now_, true);
    if (!old_index || !new_index) {
      return std::nullopt;
    }
    const auto before = number(*recorded_, *step.field, *old_index);
    const auto after = number(*now_, *step.field, *new_index);
    return before && after ? std::optional(*after - *before) : std::nullopt;
  }

 private:
  [[nodiscard]] std::string to_text(bool has_indexes) const {
    std::string text;
    for (const auto& step : path_) {
      text += text.empty() ? "" : ".";
      text += step.field == nullptr ? "(unknown)" : step.field->name();
      if (step.index >= 0) {
        text += has_indexes ? fmt::format("[{}]", step.index) : "[]";
      }
    }
    return text;
  }

  /// Index of the last field of the path in `message`, -1 if it is not repeated; none if it is
  /// missing.
  [[nodiscard]] std::optional<int> index_in(const Message& message, bool is_new) const {
    const auto& step = path_.back();
    if (!step.field->is_repeated()) {
      return -1;
    }
    const int index = is_new ? step.new_index : step.index;
    return index >= 0 && index < message.GetReflection()->FieldSize(message, step.field)
               ? std::optional(index)
               : std::nullopt;
  }

  [[nodiscard]] std::string value_in(const Message* message, bool is_new) const {
    const auto& step = path_.back();
    if (message == nullptr) {
      return kMissing;
    }
    if (step.field == nullptr) {
      return "an unknown field";
    }
    const std::optional<int> index = index_in(*message, is_new);
    return index ? value_in_words(*message, *step.field, *index) : kMissing;
  }

  const Path& path_;
  const Message* const recorded_;
  const Message* const now_;
};

/// Forwards each reported difference.
class Reporter final : public MessageDifferencer::Reporter {
 public:
  explicit Reporter(const std::function<void(const FieldDifference&)>& visit) : visit_(visit) {}

  void ReportAdded(const Message&, const Message& now, const Path& path) override {
    visit_(Reported(path, nullptr, &now));
  }
  void ReportDeleted(const Message& recorded, const Message&, const Path& path) override {
    visit_(Reported(path, &recorded, nullptr));
  }
  void ReportModified(const Message& recorded, const Message& now, const Path& path) override {
    // Of a nested message its own fields are reported.
    const FieldDescriptor* field = path.back().field;
    if (field == nullptr || field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
      visit_(Reported(path, &recorded, &now));
    }
  }

 private:
  const std::function<void(const FieldDifference&)>& visit_;
};

}  // namespace

void for_each_difference(const Message& recorded, const Message& now,
                         const std::function<void(const FieldDifference&)>& visit) {
  google::protobuf::util::DefaultFieldComparator comparator;
  comparator.set_float_comparison(google::protobuf::util::DefaultFieldComparator::EXACT);
  comparator.set_treat_nan_as_equal(true);
  Reporter reporter(visit);
  MessageDifferencer differencer;
  differencer.set_field_comparator(&comparator);
  differencer.ReportDifferencesTo(&reporter);
  static_cast<void>(differencer.Compare(recorded, now));
}

}  // namespace fastcycle::host
