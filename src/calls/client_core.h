#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calls/call_head.h"
#include "component/service_end.h"
#include "config/problem.h"
#include "executor/actor.h"
#include "fastcycle/service.h"

namespace fastcycle::detail {

class ComponentCore;

/// One component's end of a service that it calls: owns its open calls, and the deadline of each.
///
/// A place among `max_open` is taken by a call until the server has answered it, even if the caller
/// gave it up before: so what waits for the server is bounded, and no queue of calls overflows.
///
/// @threads  Confined to the component's activations.
class ClientCore final : public ServiceEnd {
 public:
  struct Statistics {
    std::uint64_t calls = 0;
    std::uint64_t replies = 0;          ///< Callbacks called.
    std::uint64_t ignored_replies = 0;  ///< Which came when nobody waited any more.
  };

  ClientCore(ComponentCore& core, std::string service, std::size_t max_open);

  /// Declares its topics, again if the component is restarted.
  void declare(const google::protobuf::Message& request, const google::protobuf::Message& reply,
               const google::protobuf::Message* feedback);

  /// A second client of this service, in the same component, has to be of the same types.
  void check_types(config::Problems& problems, const google::protobuf::Message& request,
                   const google::protobuf::Message& reply,
                   const google::protobuf::Message* feedback) const;

  std::uint64_t call(Envelope* request, const CallOptions& options, ReplyCallback callback,
                     GoalCallbacks goal);
  void cancel(std::uint64_t number);
  [[nodiscard]] bool is_open(std::uint64_t number) const noexcept;

  /// That of `ComponentCore::clients` as what it is.
  [[nodiscard]] static ClientCore& of(ServiceEnd& client) noexcept {
    return static_cast<ClientCore&>(client);
  }

  void end_all(CallStatus status, std::string_view reason) override;
  void abandon(std::string_view what) override;

  /// Requests that wait for a server, at most: those that are open, and what is said of calls that
  /// were given up.
  [[nodiscard]] std::size_t lane_depth() const noexcept { return 3 * places_.size(); }

  [[nodiscard]] PublisherCore& requests() const noexcept { return *requests_; }
  [[nodiscard]] const Statistics& statistics() const noexcept { return statistics_; }

  const std::uint64_t id;
  bool is_goal_client = false;  ///< Of an action.
  bool has_server = false;      ///< Set once when the application is built.

 private:
  enum class State : std::uint8_t {
    kFree,
    kOpen,
    kGivenUp,  ///< The caller does not wait, but the server has not answered.
  };
  struct Place {
    State state = State::kFree;
    bool is_accepted = false;
    std::uint64_t number = 0;
    std::int64_t deadline_ns = 0;  ///< `kNever` if there is none.
    Duration deadline{0};
    Origin origin{};
    Ticket behalf{};
    ReplyCallback callback;
    GoalCallbacks goal;
  };
  /// A reply that does not come from a server.
  struct OwnReply {
    CallStatus status;
    std::string reason;
    Origin origin;
    Ticket behalf;
    ReplyCallback callback;
  };

  [[nodiscard]] Place* find(std::uint64_t number) noexcept;
  [[nodiscard]] Origin origin_of_call() const noexcept;
  std::uint64_t refuse(Envelope* request, OwnReply reply);
  void post(OwnReply reply);
  void give_own_reply();
  void send(std::uint64_t number, CallHead::Kind kind);
  void give_up(Place& place);
  void take_reply(Envelope& envelope, const google::protobuf::Message& payload);
  void take_feedback(Envelope& envelope, const google::protobuf::Message& payload);
  void accept(Place& place);
  void on_deadline();
  void arm();
  void give(const OwnReply& reply, Envelope* envelope);

  ComponentCore& core_;
  PublisherCore* requests_ = nullptr;
  const google::protobuf::Message* reply_ = nullptr;
  const google::protobuf::Message* feedback_ = nullptr;
  TimerCore* timer_ = nullptr;
  std::vector<Place> places_;
  std::uint64_t calls_ = 0;
  std::deque<OwnReply> own_replies_;
  CallHead head_;  ///< Of the call being made; keeps its capacity.
  Statistics statistics_;
};

}  // namespace fastcycle::detail
