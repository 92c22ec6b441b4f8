#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include <google/protobuf/timestamp.pb.h>

#include "ros2/cdr.h"

namespace fastcycle::ros2 {

inline constexpr std::int64_t kSecond_ns = 1'000'000'000;

struct Header {
  std::int64_t time_ns = 0;
  std::string frame;
};

inline Header read_header(CdrReader& in) {
  const std::int64_t seconds = in.number<std::int32_t>("header.stamp.sec");
  const auto rest_ns = in.number<std::uint32_t>("header.stamp.nanosec");
  return {.time_ns = seconds * kSecond_ns + rest_ns, .frame = in.text("header.frame_id")};
}

inline void set_time(std::int64_t time_ns, google::protobuf::Timestamp& out) {
  const std::int64_t rest_ns = (time_ns % kSecond_ns + kSecond_ns) % kSecond_ns;
  out.set_seconds((time_ns - rest_ns) / kSecond_ns);
  out.set_nanos(static_cast<std::int32_t>(rest_ns));
}

/// The fields at the beginning of every Foxglove message.
template <typename T>
void take_header(CdrReader& in, T& out) {
  Header header = read_header(in);
  set_time(header.time_ns, *out.mutable_timestamp());
  out.set_frame_id(std::move(header.frame));
}

inline void put_time(const google::protobuf::Timestamp& time, CdrWriter& out) {
  if (!std::in_range<std::int32_t>(time.seconds()) || time.nanos() < 0 ||
      time.nanos() >= kSecond_ns) {
    out.fail("stamp", "seconds within 32 bits, and less than a second of nanoseconds",
             std::to_string(time.seconds()) + " s and " + std::to_string(time.nanos()) + " ns");
  }
  out.number(static_cast<std::int32_t>(time.seconds()));
  out.number(static_cast<std::uint32_t>(time.nanos()));
}

template <typename T>
void put_header(const T& in, CdrWriter& out) {
  put_time(in.timestamp(), out);
  out.text(in.frame_id(), "header.frame_id");
}

}  // namespace fastcycle::ros2
