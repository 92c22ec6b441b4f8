#include "calls/call_head.h"

#include <algorithm>

#include <google/protobuf/unknown_field_set.h>

#include "broker/topics.h"
#include "component/service_topics.h"

namespace fastcycle::detail {
namespace {

using google::protobuf::Message;
using google::protobuf::UnknownField;
using google::protobuf::UnknownFieldSet;

constexpr int kNumber = kFirstHeadField;
constexpr int kKind = kFirstHeadField + 1;  // Of a reply: its status.
constexpr int kDeadline = kFirstHeadField + 2;
constexpr int kPath = kFirstHeadField + 3;
constexpr int kReason = kFirstHeadField + 4;
constexpr std::uint64_t kAccepted = 255;  // In place of a status.

bool is_of_head(const UnknownField& field) {
  return field.number() >= kFirstHeadField && field.number() <= kLastHeadField;
}

/// The message's fields of unknown numbers, without those of an existing head: copying a request
/// into another one copies its head too.
UnknownFieldSet& fields_of(Message& message) {
  UnknownFieldSet& fields = *message.GetReflection()->MutableUnknownFields(&message);
  for (int i = fields.field_count() - 1; i >= 0; --i) {
    if (is_of_head(fields.field(i))) {
      fields.DeleteSubrange(i, 1);
    }
  }
  return fields;
}

/// Calls `take(field)` with each field of the head; whether it has a number.
template <typename Take>
bool read_fields(const Message& message, const Take& take) {
  const UnknownFieldSet& fields = message.GetReflection()->GetUnknownFields(message);
  bool has_number = false;
  for (int i = 0; i < fields.field_count(); ++i) {
    const UnknownField& field = fields.field(i);
    if (is_of_head(field)) {
      has_number = has_number || field.number() == kNumber;
      take(field);
    }
  }
  return has_number;
}

/// Of a field that may come from a damaged file.
std::uint64_t number_of(const UnknownField& field) {
  switch (field.type()) {
    case UnknownField::TYPE_VARINT:
      return field.varint();
    case UnknownField::TYPE_FIXED64:
      return field.fixed64();
    default:
      return 0;
  }
}

}  // namespace

void write_head(Message& message, const CallHead& head) {
  UnknownFieldSet& fields = fields_of(message);
  fields.AddVarint(kNumber, head.number);
  if (head.kind != CallHead::Kind::kRequest) {
    fields.AddVarint(kKind, static_cast<std::uint64_t>(head.kind));
  }
  if (head.deadline_ns) {
    fields.AddFixed64(kDeadline, static_cast<std::uint64_t>(*head.deadline_ns));
  }
  for (const std::uint64_t service : head.path) {
    fields.AddFixed64(kPath, service);
  }
}

void write_head(Message& message, const ReplyHead& head) {
  UnknownFieldSet& fields = fields_of(message);
  fields.AddVarint(kNumber, head.number);
  if (head.is_accepted) {
    fields.AddVarint(kKind, kAccepted);
  } else if (head.status != CallStatus::kOk) {
    fields.AddVarint(kKind, static_cast<std::uint64_t>(head.status));
  }
  if (!head.reason.empty()) {
    fields.AddLengthDelimited(kReason, head.reason);
  }
}

bool read_head(const Message& message, CallHead& head) {
  return read_fields(message, [&](const UnknownField& field) {
    switch (field.number()) {
      case kNumber:
        head.number = number_of(field);
        break;
      case kKind:
        head.kind = static_cast<CallHead::Kind>(
            std::min(number_of(field), static_cast<std::uint64_t>(CallHead::Kind::kCancel)));
        break;
      case kDeadline:
        head.deadline_ns = static_cast<std::int64_t>(number_of(field));
        break;
      case kPath:
        head.path.push_back(number_of(field));
        break;
      default:
        break;
    }
  });
}

bool read_head(const Message& message, ReplyHead& head) {
  return read_fields(message, [&](const UnknownField& field) {
    switch (field.number()) {
      case kNumber:
        head.number = number_of(field);
        break;
      case kKind:
        head.is_accepted = number_of(field) == kAccepted;
        head.status = static_cast<CallStatus>(
            std::min(number_of(field), static_cast<std::uint64_t>(CallStatus::kShutdown)));
        break;
      case kReason:
        if (field.type() == UnknownField::TYPE_LENGTH_DELIMITED) {
          head.reason = field.length_delimited();
        }
        break;
      default:
        break;
    }
  });
}

std::uint64_t service_id(std::string_view service) noexcept {
  return publisher_id(service, kRequestTopic);
}

}  // namespace fastcycle::detail

namespace fastcycle {

const char* to_word(CallStatus status) noexcept {
  switch (status) {
    case CallStatus::kOk:
      return "ok";
    case CallStatus::kAbsent:
      return "absent";
    case CallStatus::kBusy:
      return "busy";
    case CallStatus::kFaulted:
      return "faulted";
    case CallStatus::kLate:
      return "late";
    case CallStatus::kCancelled:
      return "cancelled";
    case CallStatus::kCycle:
      return "cycle";
    case CallStatus::kRejected:
      return "rejected";
    case CallStatus::kAborted:
      return "aborted";
    case CallStatus::kUnanswered:
      return "unanswered";
    case CallStatus::kShutdown:
      return "shutdown";
  }
  return "?";
}

}  // namespace fastcycle
