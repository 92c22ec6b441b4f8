#include "dds_gateway/request_header.h"

#include <cstdint>
#include <cstring>

#include "ros2/cdr.h"

namespace fastcycle::dds_gateway {

Guid asker_of(std::uint64_t client) {
  Guid asker{};
  std::memcpy(asker.data(), &client, sizeof client);
  return asker;
}

ros2::Buffer with_request_header(std::span<const std::byte> message, const Identity& request) {
  ros2::Buffer result;
  result.reserve(message.size() + kRequestHeaderBytes);
  ros2::CdrWriter out(result);
  std::uint64_t client = 0;
  std::memcpy(&client, request.asker.data(), sizeof client);
  out.number(client);
  out.number(request.number);
  const auto body = message.subspan(ros2::kEncapsulationBytes);
  std::memcpy(result.grow(body.size()), body.data(), body.size());
  return result;
}

ros2::Buffer without_request_header(std::span<const std::byte> message, Identity& request) {
  ros2::CdrReader in(message);
  request.asker = asker_of(in.number<std::uint64_t>("client"));
  in.number("number", request.number);
  ros2::Buffer result;
  std::memcpy(result.grow(ros2::kEncapsulationBytes), message.data(), ros2::kEncapsulationBytes);
  const auto body = message.subspan(ros2::kEncapsulationBytes + kRequestHeaderBytes);
  std::memcpy(result.grow(body.size()), body.data(), body.size());
  return result;
}

}  // namespace fastcycle::dds_gateway
