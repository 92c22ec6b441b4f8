// Reads any bytes as a message of ROS: the first of them chooses the type. What is not reported by
// a `CdrError` is a bug of ours, and so is a message that is much larger than what it was made of.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "fastcycle/assert.h"
#include "ros2/error.h"
#include "ros2_types/known_types.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fastcycle::ros2;
  if (size == 0) {
    return 0;
  }
  static KnownTypes types;
  const Mapping& mapping = types.mappings().all()[data[0] % types.mappings().all().size()];
  const Converter& type = types.find(mapping.ros, mapping.message);
  const std::unique_ptr<google::protobuf::Message> message(type.prototype().New());
  try {
    type.to_message(std::as_bytes(std::span(data, size)).subspan(1), *message);
  } catch (const CdrError&) {
    return 0;
  }
  const std::string serialized = message->SerializeAsString();
  constexpr std::size_t kFieldsBytes = 512 * 1024;  // A point may have many, with long names.
  FASTCYCLE_ASSERT(serialized.size() <= 8 * size + kFieldsBytes,
                   "it grows by no more than its shape");
  FASTCYCLE_ASSERT(message->ParseFromString(serialized), "what is written can be read");
  return 0;
}
