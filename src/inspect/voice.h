#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "broker/publisher_core.h"
#include "host/application.h"
#include "inspect/inspect.pb.h"
#include "record/tap.h"

namespace fastcycle::inspect {

/// Publishes messages and calls services on behalf of tools.
///
/// It is an external publisher of every topic, declared before the application runs; its messages
/// are delivered, counted and recorded like any others. It exists only if the application allows
/// it: it adds a queue to each subscription.
///
/// @threads  `declare`, `open` and `close`: the control thread; all else: the server's.
class Voice {
 public:
  /// Its publisher name. When a recording with messages of that publisher is replayed, "_" is
  /// appended.
  static constexpr const char* kName = "fastcycle/inspect";

  explicit Voice(host::Application& application);

  /// Call when all components are constructed and no topic is connected yet.
  void declare();
  /// `open` starts delivery of what it publishes; `close` ends it.
  void open();
  void close();

  /// Publishes a serialized message on `topic`.
  ///
  /// @errors  `Refusal`: there is no such topic, or the message is not of its type.
  void publish(const std::string& topic, const std::string& serialized);

  /// Calls `service`; `look` reports the outcome to `done`, unless the application stops before.
  ///
  /// @errors  `Refusal`: no such service, the message is no request of it, or a call is in
  ///          progress.
  using Done = std::function<void(protocol::Reply reply)>;
  void call(const std::string& service, const std::string& serialized, std::int64_t timeout_ns,
            Done done);
  /// Polls for replies.
  void look();
  [[nodiscard]] bool is_waiting() const noexcept;

 private:
  struct NullStage final : public detail::Stage {
    void put(detail::PublisherCore&, detail::Envelope*) override {}
  };
  /// One service, and the call that is in progress.
  struct Line {
    detail::PublisherCore* requests = nullptr;
    PublisherId replies = 0;
    std::uint64_t number = 0;
    std::int64_t end_ns = 0;  ///< CLOCK_MONOTONIC deadline of the reply.
    bool is_owed = false;     ///< The server has not answered yet.
    Done done;
  };

  detail::PublisherCore& publisher_of(const std::string& topic) const;
  void publish(detail::PublisherCore& publisher, const std::string& serialized,
               const std::function<void(google::protobuf::Message&)>& add);
  void take_reply(const detail::Lane& lane, const detail::Envelope& envelope);

  host::Application& application_;
  NullStage stage_;
  detail::PublishingComponent owner_;
  std::map<std::string, detail::PublisherCore*> publishers_;
  std::map<std::string, Line> lines_;  ///< By service.
  record::Tap replies_;
};

}  // namespace fastcycle::inspect
