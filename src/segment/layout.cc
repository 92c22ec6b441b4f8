#include "segment/layout.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/generated_message_reflection.h>
#include <google/protobuf/repeated_field.h>

#include "base/shared_memory.h"

namespace pb = google::protobuf;

namespace google::protobuf {

// Generated messages declare a friend class of this name, which anyone may define.
class MessageLayoutInspector {
 public:
  static const internal::ReflectionSchema& schema(const Reflection& reflection) {
    return reflection.schema_;
  }
};

}  // namespace google::protobuf

namespace fastcycle::segment {
namespace {

template <typename T>
const T& at(const char* object, std::uint32_t offset) {
  return *reinterpret_cast<const T*>(object + offset);
}

bool is_inside(const void* address) {
  return base::shared_memory.is_own(address);
}

Layout::Verdict check_string(const std::string* text) {
  if (!is_inside(text)) {
    return Layout::Verdict::kOutside;
  }
  if (is_inside(text->data())) [[likely]] {
    return Layout::Verdict::kInside;
  }
  std::string copy(*text);  // In the segment, unless that is full.
  const_cast<std::string*>(text)->swap(copy);
  return is_inside(text->data()) ? Layout::Verdict::kRepaired : Layout::Verdict::kOutside;
}

}  // namespace

const Layout& Layout::of(const pb::Message& message) {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  return find_or_make(message);
}

const Layout& Layout::find_or_make(const pb::Message& message) {
  static auto& known = *new std::map<const pb::Descriptor*, std::unique_ptr<Layout>>;
  auto& entry = known[message.GetDescriptor()];
  if (entry == nullptr) {
    entry = std::make_unique<Layout>();
    entry->fill(message);
  }
  return *entry;
}

void Layout::fill(const pb::Message& message) {
  const pb::Descriptor* const type = message.GetDescriptor();
  const pb::internal::ReflectionSchema& schema =
      pb::MessageLayoutInspector::schema(*message.GetReflection());
  metadata_offset_ = schema.GetMetadataOffset();
  if (schema.HasExtensionSet()) {
    always_copied_ = "its type has extensions";
  } else if (schema.HasWeakFields() || schema.HasInlinedString()) {
    always_copied_ = "its type is laid out in an unusual way";
  }
  for (int i = 0; i < type->field_count(); ++i) {
    const pb::FieldDescriptor* const field = type->field(i);
    const bool is_string = field->cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING;
    const bool is_message = field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE;
    if (!field->is_repeated() && !is_string && !is_message) {
      continue;
    }
    Place place{.kind = is_string ? Kind::kString : Kind::kMessage,
                .offset = schema.GetFieldOffset(field),
                .case_offset = 0,
                .number = static_cast<std::uint32_t>(field->number()),
                .child = nullptr};
    if (is_message) {
      place.child = &find_or_make(
          *pb::MessageFactory::generated_factory()->GetPrototype(field->message_type()));
      if (field->is_map()) {
        always_copied_ = "its type has maps";
      } else if (always_copied_ == nullptr) {
        always_copied_ = place.child->always_copied_;
      }
    }
    if (field->is_repeated()) {
      place.kind = is_string ? Kind::kStrings : is_message ? Kind::kMessages : Kind::kScalars;
    }
    if (schema.InRealOneof(field)) {
      place.case_offset = schema.GetOneofCaseOffset(field->containing_oneof());
    }
    places_.push_back(place);
  }
}

Layout::Verdict Layout::check(pb::Message& message) const {
  const char* const object = reinterpret_cast<const char*>(&message);
  const bool has_unknown_fields = (at<std::uintptr_t>(object, metadata_offset_) & 1) != 0;
  if (!is_inside(object) || always_copied_ != nullptr || has_unknown_fields) {
    return Verdict::kOutside;
  }
  Verdict result = Verdict::kInside;
  const auto add = [&result](Verdict verdict) { result = std::max(result, verdict); };
  for (const Place& place : places_) {
    if (place.case_offset != 0 && at<std::uint32_t>(object, place.case_offset) != place.number) {
      continue;
    }
    switch (place.kind) {
      case Kind::kString: {
        // The two lowest bits encode ownership; 0: the default, which is in a library.
        const auto tagged = at<std::uintptr_t>(object, place.offset);
        if ((tagged & 3) != 0) {
          add(check_string(reinterpret_cast<const std::string*>(tagged & ~std::uintptr_t{3})));
        }
        break;
      }
      case Kind::kMessage: {
        auto* const child = at<pb::Message*>(object, place.offset);
        if (child != nullptr) {
          add(place.child->check(*child));
        }
        break;
      }
      case Kind::kScalars: {
        const auto& field = at<pb::RepeatedField<std::int64_t>>(object, place.offset);
        if (field.Capacity() != 0 && !is_inside(field.data())) {
          return Verdict::kOutside;
        }
        break;
      }
      case Kind::kStrings: {
        const auto& field = at<pb::RepeatedPtrField<std::string>>(object, place.offset);
        if (!field.empty() && !is_inside(field.data())) {
          return Verdict::kOutside;
        }
        for (const std::string& text : field) {
          add(check_string(&text));
        }
        break;
      }
      case Kind::kMessages: {
        const auto& field = at<pb::RepeatedPtrField<pb::Message>>(object, place.offset);
        if (!field.empty() && !is_inside(field.data())) {
          return Verdict::kOutside;
        }
        for (const pb::Message& child : field) {
          add(place.child->check(const_cast<pb::Message&>(child)));
        }
        break;
      }
    }
    if (result == Verdict::kOutside) {
      return result;
    }
  }
  return result;
}

bool Layout::holds_here() {
  // A message type of protobuf with a string, repeated strings and a number; on the normal heap.
  static_assert(sizeof(std::string) == 32, "a string without a count of references");
  pb::FieldDescriptorProto probe;
  probe.set_name("a name that is longer than what fits into the string itself");
  probe.mutable_options()->set_lazy(true);
  const Layout& layout = of(probe);
  const char* const object = reinterpret_cast<const char*>(&probe);
  bool has_name = false;
  bool has_options = false;
  for (const Place& place : layout.places_) {
    if (place.number == pb::FieldDescriptorProto::kNameFieldNumber) {
      const auto tagged = at<std::uintptr_t>(object, place.offset);
      has_name = reinterpret_cast<const std::string*>(tagged & ~std::uintptr_t{3}) ==
                     &std::as_const(probe).name() &&
                 (tagged & 3) != 0;
    } else if (place.number == pb::FieldDescriptorProto::kOptionsFieldNumber) {
      has_options = at<const pb::Message*>(object, place.offset) == &probe.options();
    }
  }
  return has_name && has_options;
}

}  // namespace fastcycle::segment
