#pragma once

#include <string>

namespace google::protobuf {
class Descriptor;
}

namespace fastcycle::record {

/// A serialized `FileDescriptorSet` with the file that defines `type` and all its imports,
/// dependencies first: what a reader on another machine needs to decode messages of `type`.
[[nodiscard]] std::string descriptor_set_of(const google::protobuf::Descriptor& type);

}  // namespace fastcycle::record
