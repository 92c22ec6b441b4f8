#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/message.h>

#include "fastcycle/service.h"

namespace fastcycle::detail {

/// What is said of a call beside the request or the reply itself.
///
/// It travels in the message: as fields of numbers that no message has, which protobuf keeps,
/// writes into recordings and reads again without knowing them. So requests and replies are
/// ordinary messages of ordinary topics.
struct CallHead {
  /// What a message of the topic `…#request` is.
  enum class Kind : std::uint8_t {
    kRequest,
    kGiveUp,  ///< The caller does not wait any more.
    kCancel,  ///< Of a goal: please come to an end; the caller waits for the result.
  };

  std::uint64_t number = 0;  ///< The call, as its client counts.
  Kind kind = Kind::kRequest;
  std::optional<std::int64_t> deadline_ns = {};
  /// The services whose answers wait for this one, outermost first, by `service_id`.
  std::vector<std::uint64_t> path = {};
};

/// The same of a reply.
struct ReplyHead {
  std::uint64_t number = 0;
  CallStatus status = CallStatus::kOk;
  bool is_accepted = false;  ///< A goal was accepted; the reply is still to come.
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

/// Names a service in paths, the same in every run.
[[nodiscard]] std::uint64_t service_id(std::string_view service) noexcept;

}  // namespace fastcycle::detail
