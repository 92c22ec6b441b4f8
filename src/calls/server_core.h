#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calls/call_head.h"
#include "component/service_end.h"
#include "executor/actor.h"
#include "fastcycle/service.h"

namespace fastcycle::detail {

class ComponentCore;

/// One component's end of a service that it provides: owns its pending requests.
///
/// Every request gets exactly one reply from here, also after the component has failed: its inbox
/// of requests stays open until the application stops. So callers do not depend on the server's
/// state, and a recording has all that the caller received.
///
/// @threads  Confined to the component's activations; `add_client` to the control thread before the
///           start.
class ServerCore final : public ServiceEnd {
 public:
  ServerCore(ComponentCore& core, std::string service, std::size_t depth);

  /// Sets the declaration of the component's present object.
  void declare(ServerSpec spec);

  /// Declares its topic; `depth` messages of each client may wait.
  void listen(std::size_t depth);

  /// Sets where the client that publishes `requests` receives its replies, and its feedback.
  void add_client(PublisherId requests, PublisherCore& replies, PublisherCore* feedback);

  [[nodiscard]] bool owes(const Ticket& ticket) const noexcept;
  [[nodiscard]] bool is_cancelling(const Ticket& ticket) const noexcept;
  [[nodiscard]] std::optional<Time> deadline_of(const Ticket& ticket) const noexcept;
  /// The services that wait for the answer, this one last. @pre `owes(ticket)`
  [[nodiscard]] const std::vector<std::uint64_t>& path_of(const Ticket& ticket) const noexcept;
  /// Of the request's client; of any client once it is answered, since nothing is sent then.
  [[nodiscard]] PublisherCore& replies_of(const Ticket& ticket) const noexcept;
  [[nodiscard]] PublisherCore& feedback_of(const Ticket& ticket) const noexcept;

  void answer(const Ticket& ticket, CallStatus status, std::string_view reason, Envelope* reply,
              PublisherCore* lender) noexcept;
  void publish_feedback(const Ticket& ticket, Envelope* feedback, PublisherCore* lender);
  /// Downcast of an element of `ComponentCore::servers`.
  [[nodiscard]] static ServerCore& of(ServiceEnd& server) noexcept {
    return static_cast<ServerCore&>(server);
  }

  void end_all(CallStatus status, std::string_view reason) override;
  void abandon(std::string_view what) override;

  /// Answers after the caller had given up.
  [[nodiscard]] std::uint64_t late_answers() const noexcept { return late_answers_; }

  ComponentCore& core;
  const std::uint64_t id;
  const google::protobuf::Message* request_instance = nullptr;
  const google::protobuf::Message* reply_instance = nullptr;
  const google::protobuf::Message* feedback_instance = nullptr;
  CallbackSubscription* requests = nullptr;

 private:
  struct Client {
    PublisherId id;
    PublisherCore* replies;
    PublisherCore* feedback;
  };
  struct Owed {
    std::uint64_t serial = 0;  ///< 0: no pending request here.
    const Client* client = nullptr;
    std::uint64_t number = 0;
    std::optional<std::int64_t> deadline_ns = {};
    bool is_cancelling = false;
    bool is_dropped = false;  ///< Its responder was destroyed by an exception.
    Origin origin{};
    std::vector<Trail> trails = {};  ///< By root; empty if there are no chains.
    std::vector<std::uint64_t> path = {};
  };

  void take(Envelope& envelope, const google::protobuf::Message& payload);
  void take_request(const Client& client, Envelope& envelope,
                    const google::protobuf::Message& payload);
  void take_cancel(const Client& client);
  [[nodiscard]] const Client& client_of(const Ticket& ticket) const noexcept;
  void drop(Owed& owed);
  void answer_dropped();
  void reply(const Client& client, const ReplyHead& head, Envelope* message);

  std::vector<Client> clients_;
  std::vector<Owed> owed_;
  std::uint64_t serials_ = 0;
  std::uint64_t late_answers_ = 0;
  bool defers_ = false;
  RequestCallback callback_;
  CancelCallback on_cancel_;
  CallHead head_;  ///< Of the message being taken; keeps its capacity.
};

}  // namespace fastcycle::detail
