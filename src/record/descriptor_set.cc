#include "record/descriptor_set.h"

#include <set>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

namespace fastcycle::record {
namespace {

using google::protobuf::FileDescriptor;

void add(const FileDescriptor& file, std::set<const FileDescriptor*>& known,
         google::protobuf::FileDescriptorSet& set) {
  if (!known.insert(&file).second) {
    return;
  }
  for (int i = 0; i < file.dependency_count(); ++i) {
    add(*file.dependency(i), known, set);
  }
  file.CopyTo(set.add_file());
}

}  // namespace

std::string descriptor_set_of(const google::protobuf::Descriptor& type) {
  google::protobuf::FileDescriptorSet set;
  std::set<const FileDescriptor*> known;
  add(*type.file(), known, set);
  return set.SerializeAsString();
}

}  // namespace fastcycle::record
