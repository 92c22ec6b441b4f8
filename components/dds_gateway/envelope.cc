#include "dds_gateway/envelope.h"

#include <climits>

#include <fmt/format.h>

#include "base/clock.h"
#include "dds_gateway/wire_time.h"
#include "record/descriptor_set.h"
#include "ros2/cdr.h"
#include "ros2/sha256.h"

namespace fastcycle::dds_gateway {
namespace {

// Minimum sizes: lengths of empty texts and sequences, and numbers.
constexpr std::size_t kTrailBytes = 24;
constexpr std::size_t kHopBytes = 40;
constexpr std::size_t kHeadBytes = 256;
constexpr std::uint32_t kWaysMax = 64;  // Trails of a message, and hops of each.

std::uint32_t count_of(ros2::CdrReader& in, const char* field, std::size_t least_bytes) {
  const std::uint32_t count = in.count(field, least_bytes);
  if (count > kWaysMax) {
    in.fail(field, fmt::format("at most {}", kWaysMax), fmt::format("{}", count));
  }
  return count;
}

}  // namespace

void write_envelope(const google::protobuf::Message& message, const EnvelopeHead& head,
                    ros2::Buffer& out) {
  ros2::CdrWriter writer(out, kEnvelopeType);
  const std::size_t size = message.ByteSizeLong();
  if (size > INT_MAX) {
    writer.fail("payload", fmt::format("at most {} bytes", INT_MAX), fmt::format("{}", size));
  }
  out.reserve(out.size() + size + kHeadBytes);
  writer.text(message.GetTypeName());
  writer.number(head.clock);
  writer.number(head.number);
  writer.number(head.sequence);
  writer.number(base::to_ns(head.published));
  writer.number(head.root);
  writer.number(base::to_ns(head.taken));
  writer.count(head.trails.size());
  for (const EnvelopeTrail& trail : head.trails) {
    writer.text(trail.root);
    writer.number(base::to_ns(trail.taken));
    writer.count(trail.hops.size());
    for (const EnvelopeHop& hop : trail.hops) {
      writer.number(hop.publisher);
      writer.text(hop.component);
      writer.text(hop.topic);
      writer.number(base::to_ns(hop.begin));
      writer.number(base::to_ns(hop.published));
    }
  }
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
  const auto read_time = [&](const char* field) { return read_wire_time(in, field); };
  EnvelopeHead head;
  in.number("clock", head.clock);
  in.number("number", head.number);
  in.number("sequence", head.sequence);
  head.published = read_time("published_ns");
  in.number("root", head.root);
  head.taken = read_time("taken_ns");
  head.trails.resize(count_of(in, "trails", kTrailBytes));
  for (EnvelopeTrail& trail : head.trails) {
    trail.root = in.view("trails[].root");
    trail.taken = read_time("trails[].taken_ns");
    trail.hops.resize(count_of(in, "trails[].hops", kHopBytes));
    for (EnvelopeHop& hop : trail.hops) {
      in.number("hops[].publisher", hop.publisher);
      hop.component = in.view("hops[].component");
      hop.topic = in.view("hops[].topic");
      hop.begin = read_time("hops[].begin_ns");
      hop.published = read_time("hops[].published_ns");
    }
  }
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
