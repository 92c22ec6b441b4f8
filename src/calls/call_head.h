#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/message.h>

#include "fastcycle/service.h"

namespace fastcycle::detail {

/// Metadata of a call, besides the request or the reply itself.
///
/// It is stored in the message: as unknown fields with reserved numbers, which protobuf preserves,
/// also in recordings. So requests and replies are ordinary messages of ordinary topics.
struct CallHead {
  /// The kind of a message of the topic `…#request`.
  enum class Kind : std::uint8_t {
    kRequest,
    kGiveUp,  ///< The caller waits no more.
    kCancel,  ///< Of a goal: a request to end; the caller waits for the result.
  };

  std::uint64_t number = 0;  ///< The call's number at its client.
  Kind kind = Kind::kRequest;
  std::optional<std::int64_t> deadline_ns = {};
  /// The services whose answers wait for this one, outermost first, by `service_id`.
  std::vector<std::uint64_t> path = {};
};

/// The same for a reply.
struct ReplyHead {
  std::uint64_t number = 0;
  CallStatus status = CallStatus::kOk;
  bool is_accepted = false;  ///< A goal was accepted; the reply follows later.
  std::string reason = {};   ///< Of an error.
};

/// The numbers that no field of a request or a reply may have.
inline constexpr int kFirstHeadField = 536'870'900;
inline constexpr int kLastHeadField = 536'870'911;

void write_head(google::protobuf::Message& message, const CallHead& head);
void write_head(google::protobuf::Message& message, const ReplyHead& head);
/// False if it has none.
bool read_head(const google::protobuf::Message& message, CallHead& head);
bool read_head(const google::protobuf::Message& message, ReplyHead& head);

/// Identifies a service in paths, the same in every run.
[[nodiscard]] std::uint64_t service_id(std::string_view service) noexcept;

}  // namespace fastcycle::detail
