#pragma once

#include <string>

namespace google::protobuf {
class Descriptor;
}

namespace fastcycle::record {

/// In what the message type of a recording differs from `type`, which has the same name, as a
/// sentence about the first field that does; empty if messages mean the same in both.
///
/// `schema` is a serialized `FileDescriptorSet`; one that cannot be read is a difference too.
[[nodiscard]] std::string schema_difference(const std::string& schema,
                                            const google::protobuf::Descriptor& type);

}  // namespace fastcycle::record
