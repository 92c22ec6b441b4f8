#include "dds_gateway/envelope.h"

#include <chrono>
#include <climits>

#include <fmt/format.h>

#include "record/descriptor_set.h"
#include "ros2/cdr.h"
#include "ros2/sha256.h"

namespace fastcycle::dds_gateway {
namespace {

std::int64_t nanoseconds_of(Time time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

Time time_of(std::int64_t time_ns) {
  return Time(std::chrono::duration_cast<Duration>(std::chrono::nanoseconds(time_ns)));
}

}  // namespace

void write_envelope(const google::protobuf::Message& message, const MessageInfo& info,
                    ros2::Buffer& out) {
  ros2::CdrWriter writer(out, kEnvelopeType);
  const std::size_t size = message.ByteSizeLong();
  if (size > INT_MAX) {
    writer.fail("payload", fmt::format("at most {} bytes", INT_MAX), fmt::format("{}", size));
  }
  out.reserve(out.size() + size + 256);
  writer.text(message.GetTypeName());
  writer.number(info.sequence);
  writer.number(nanoseconds_of(info.publish_time));
  writer.number(nanoseconds_of(info.origin.root != 0 ? info.origin.taken : info.publish_time));
  writer.count(size);
  message.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(writer.raw(size, 1)));
  writer.end();
}

EnvelopeHead read_envelope(std::span<const std::byte> bytes, google::protobuf::Message& out) {
  ros2::CdrReader in(bytes, kEnvelopeType);
  const std::string_view type = in.view("type");
  if (type != out.GetTypeName()) {
    in.fail("type", out.GetTypeName(), type);
  }
  EnvelopeHead head;
  in.number("sequence", head.sequence);
  head.published = time_of(in.number<std::int64_t>("published_ns"));
  head.taken = time_of(in.number<std::int64_t>("taken_ns"));
  const auto payload = in.bytes("payload");
  if (payload.size() > INT_MAX ||
      !out.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    in.fail("payload", fmt::format("a message {}", out.GetTypeName()),
            fmt::format("{} other bytes", payload.size()));
  }
  in.end();
  return head;
}

std::string envelope_user_data(const google::protobuf::Descriptor& message) {
  std::string schema;
  for (const std::byte byte : ros2::sha256(record::descriptor_set_of(message))) {
    schema += fmt::format("{:02x}", static_cast<unsigned>(byte));
  }
  return fmt::format("message={};schema={};", message.full_name(), schema);
}

}  // namespace fastcycle::dds_gateway
