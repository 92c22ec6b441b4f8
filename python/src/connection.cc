#include "connection.h"

#include <stdexcept>
#include <utility>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

namespace fastcycle::python {

std::string Connection::welcome() {
  const std::scoped_lock lock(mutex_);
  return client_.welcome().SerializeAsString();
}

std::uint32_t Connection::post(const std::string& request) {
  inspect::protocol::Request parsed;
  if (!parsed.ParseFromString(request)) {
    throw std::invalid_argument("bytes that are no fastcycle.inspect.protocol.Request");
  }
  const std::scoped_lock lock(mutex_);
  return client_.post(std::move(parsed));
}

std::optional<std::string> Connection::take(std::chrono::milliseconds patience) {
  const std::scoped_lock lock(mutex_);
  const std::optional<inspect::protocol::Answer> answer = client_.take(patience);
  return answer ? std::optional(answer->SerializeAsString()) : std::nullopt;
}

std::string protocol_schema() {
  google::protobuf::FileDescriptorSet set;
  inspect::protocol::Request::descriptor()->file()->CopyTo(set.add_file());
  return set.SerializeAsString();
}

}  // namespace fastcycle::python
