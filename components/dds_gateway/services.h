#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dds_gateway/engine.h"
#include "dds_gateway/settings.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/service.h"
#include "ros2_types/known_types.h"

namespace fastcycle::dds_gateway {

/// One service bridged in either direction: nodes of ROS 2 call this application, or this
/// application calls them.
///
/// @threads  Confined to the component, except the `Arrival`s that it creates, and its counters.
class ServiceCrossing {
 public:
  /// Called on the participant's thread with a message, which is then passed to `take` in an
  /// activation.
  using Arrival = std::function<void(const Identity&, std::span<const std::byte>)>;
  /// Called with messages for the user.
  using Report = std::function<void(const std::string&)>;

  /// Declares its client or its server.
  ///
  /// @errors  As `KnownTypes::find`.
  ServiceCrossing(Context& context, ServiceSettings settings, ros2::KnownTypes& types,
                  Report report);

  void open(Participant& participant, Arrival arrival);
  void close();
  /// A request of ROS 2, or the reply to one of ours. In an activation.
  void take(const Identity& request, std::span<const std::byte> message);

  [[nodiscard]] const ServiceSettings& settings() const { return settings_; }
  [[nodiscard]] Guid reader() const { return reader_->guid(); }
  /// Requests, or replies, lost on the way or for lack of room.
  [[nodiscard]] std::uint64_t lost() const { return reader_ == nullptr ? 0 : reader_->lost(); }
  [[nodiscard]] Guid writer() const { return writer_->guid(); }

  std::uint64_t asked = 0;     ///< Requests received from either side.
  std::uint64_t answered = 0;  ///< Replies sent.
  std::uint64_t failed = 0;    ///< Requests that failed, or were invalid.

 private:
  void ask_here(const Identity& request, std::span<const std::byte> message);
  void await_reader();
  /// State of a request to ROS 2.
  struct Sent {
    enum class What : std::int64_t { kGone, kNobodyServes, kNotTaken } what = What::kGone;
    Identity identity;
  };

  [[nodiscard]] Sent send(ros2::Buffer& request);
  void ask_there(const google::protobuf::Message& request, const detail::Ticket& ticket);
  void answer_here(const Identity& request, std::span<const std::byte> message);
  void fail(const std::string& why);

  detail::ComponentCore& core_;
  const ServiceSettings settings_;
  const Report report_;
  const ros2::Converter& request_;
  const ros2::Converter& reply_;

  detail::ClientCore* client_ = nullptr;            // Of a service provided here.
  std::map<std::int64_t, detail::Ticket> waiting_;  // By request number; of ROS 2.
  Guid asker_{};                                    // Our id in requests.

  std::unique_ptr<Reader> reader_;
  std::unique_ptr<Writer> writer_;
  bool awaits_readers_ = true;  // Of replies; false after a wait was in vain.
};

}  // namespace fastcycle::dds_gateway
