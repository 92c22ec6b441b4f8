#pragma once

#include <string>

namespace google::protobuf {
class Descriptor;
}

namespace fastcycle::record {

/// The difference between a recording's message type and `type` of the same name, as a sentence
/// about the first field that differs; empty if messages mean the same in both.
///
/// `schema` is a serialized `FileDescriptorSet`; one that cannot be read is a difference too.
[[nodiscard]] std::string schema_difference(const std::string& schema,
                                            const google::protobuf::Descriptor& type);

}  // namespace fastcycle::record
