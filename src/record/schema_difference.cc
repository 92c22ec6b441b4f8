#include "record/schema_difference.h"

#include <set>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

namespace fastcycle::record {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

/// Keeps protobuf from printing errors.
class Silence final : public google::protobuf::DescriptorPool::ErrorCollector {
 public:
  void AddError(const std::string&, const std::string&, const google::protobuf::Message*,
                ErrorLocation, const std::string&) override {}
};

/// "repeated demo.Point"
std::string kind_of(const FieldDescriptor& field) {
  std::string kind = field.is_repeated() ? "repeated " : "";
  if (const Descriptor* message = field.message_type()) {
    return kind + message->full_name();
  }
  if (const auto* names = field.enum_type()) {
    return kind + names->full_name();
  }
  return kind + field.type_name();
}

std::string field_difference(const FieldDescriptor& recorded, const FieldDescriptor* here) {
  if (here == nullptr) {
    return fmt::format("field {} = {} ({}) of the recording no longer exists", recorded.full_name(),
                       recorded.number(), kind_of(recorded));
  }
  if (kind_of(recorded) != kind_of(*here)) {
    return fmt::format("field {} = {} is {}, and was {} when it was recorded", here->full_name(),
                       here->number(), kind_of(*here), kind_of(recorded));
  }
  if (recorded.name() != here->name()) {
    return fmt::format("field {} = {} was called {} when it was recorded", here->full_name(),
                       here->number(), recorded.name());
  }
  return {};
}

std::string difference(const Descriptor& recorded, const Descriptor& here,
                       std::set<std::string>& seen) {
  if (!seen.insert(here.full_name()).second) {
    return {};
  }
  for (int i = 0; i < recorded.field_count(); ++i) {
    const FieldDescriptor& field = *recorded.field(i);
    const FieldDescriptor* same = here.FindFieldByNumber(field.number());
    std::string found = field_difference(field, same);
    if (found.empty() && field.message_type() != nullptr) {
      found = difference(*field.message_type(), *same->message_type(), seen);
    }
    if (!found.empty()) {
      return found;
    }
  }
  for (int i = 0; i < here.field_count(); ++i) {
    const FieldDescriptor& field = *here.field(i);
    if (recorded.FindFieldByNumber(field.number()) == nullptr) {
      return fmt::format("field {} = {} ({}) is not in the recording", field.full_name(),
                         field.number(), kind_of(field));
    }
  }
  return {};
}

}  // namespace

std::string schema_difference(const std::string& schema, const Descriptor& type) {
  google::protobuf::FileDescriptorSet set;
  if (!set.ParseFromString(schema)) {
    return "the schema in the recording cannot be read";
  }
  google::protobuf::DescriptorPool pool;
  Silence silence;
  for (const google::protobuf::FileDescriptorProto& file : set.file()) {
    if (pool.BuildFileCollectingErrors(file, &silence) == nullptr) {
      return "the schema in the recording, " + file.name() + ", is wrong";
    }
  }
  const Descriptor* recorded = pool.FindMessageTypeByName(type.full_name());
  if (recorded == nullptr) {
    return "the schema in the recording does not define " + type.full_name();
  }
  std::set<std::string> seen;
  return difference(*recorded, type, seen);
}

}  // namespace fastcycle::record
