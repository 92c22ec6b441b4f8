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

/// What tools may say into an application: messages, and calls of services.
///
/// It is an external publisher of every topic, declared before the application runs; so what it
/// says is delivered, counted and recorded as anybody else's. It is not there unless it is allowed:
/// each subscription has one more queue by it.
///
/// @threads  `declare`, `open` and `close` by the control thread; all else by the server's.
class Voice {
 public:
  /// Its name where publishers have one. In a replay of what tools published then, which has that
  /// name, "_" follows it.
  static constexpr const char* kName = "fastcycle/inspect";

  explicit Voice(host::Application& application);

  /// All components are constructed, no topic is connected yet.
  void declare();
  /// From now on it is heard; and from then on it is not.
  void open();
  void close();

  /// Publishes a message of `topic` in its serialized form.
  ///
  /// @errors  `Refusal`: there is no such topic, or this is no message of its type.
  void publish(const std::string& topic, const std::string& serialized);

  /// Calls `service`; `done` is told how that ended, by `look`, or not at all if the application
  /// stops before.
  ///
  /// @errors  `Refusal`: there is no such service, this is no request, or a call is open.
  using Done = std::function<void(protocol::Reply reply)>;
  void call(const std::string& service, const std::string& serialized, std::int64_t timeout_ns,
            Done done);
  /// Looks for replies.
  void look();
  [[nodiscard]] bool is_waiting() const noexcept;

 private:
  struct NullStage final : public detail::Stage {
    void put(detail::PublisherCore&, detail::Envelope*) override {}
  };
  /// One service, and the call of it that is open.
  struct Line {
    detail::PublisherCore* requests = nullptr;
    PublisherId replies = 0;
    std::uint64_t number = 0;
    std::int64_t end_ns = 0;  ///< CLOCK_MONOTONIC; what comes later is late.
    bool is_owed = false;     ///< The server has not answered.
    Done done;
  };

  detail::PublisherCore& publisher_of(const std::string& topic) const;
  void say(detail::PublisherCore& publisher, const std::string& serialized,
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
