#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include <google/protobuf/wrappers.pb.h>

#include "fastcycle/fastcycle.h"
#include "world.h"

namespace fastcycle::operations {

using google::protobuf::Int64Value;

/// A component that does something at random whenever it is called, and now and then throws.
class Player final : public Component {
 public:
  explicit Player(Context& context);
  ~Player() override;

  void start() override;
  void activate() override;
  void deactivate() override;
  void serve() override { operate(); }
  void stop() override;

 private:
  using Goal = ServerGoal<Int64Value, Int64Value>;

  void declare_inputs();
  void declare_services();
  void declare_timers();
  [[nodiscard]] SubscriberOptions options(std::size_t number);

  /// One number below `count`.
  [[nodiscard]] std::uint64_t chance(std::uint64_t count) { return random()() % count; }
  [[nodiscard]] const std::string& any(const std::vector<std::string>& names);
  /// Whether it may, and shall now.
  [[nodiscard]] bool wants(Operation operation, std::uint64_t one_in);
  void operate();
  void perform(Operation operation);
  /// Throws now and then, if `operation` says so.
  void perhaps_throw(Operation operation, std::uint64_t one_in);

  void received(const Int64Value& message);
  void happened(const QosEvent& event);
  void publish(std::int64_t value);
  void forward();
  void keep();
  void subscribe();
  void unsubscribe();
  void nest();
  void call(bool insists);
  void take_reply(const Reply<Int64Value>& reply, bool insists);
  void send_goal();
  void answer();
  void serve_request(Responder<Int64Value> responder);
  void serve_goal(Goal goal);
  void work_on_goals();
  void offload();
  void change_params();
  void send_tiles();
  void look();
  void say();
  void renew();

  Param<std::vector<std::string>> peers_;
  Param<std::vector<std::string>> modes_;
  Param<std::vector<std::string>> executors_;
  Param<std::int64_t> wildness_;  ///< Faults in a thousand calls.
  Param<std::int64_t> gain_;      ///< Changed while it runs.
  std::string name_;

  Publisher<Int64Value> out_;
  Publisher<Int64Value> shared_;
  Publisher<Int64Value> shared_too_;
  Publisher<Int64Value> forwarded_;
  Publisher<Int64Value> tiles_;
  std::vector<Latest<Int64Value>> latest_;
  std::vector<History<Int64Value>> history_;
  std::vector<Timer> timers_;
  std::vector<Client<Int64Value, Int64Value>> clients_;
  std::vector<ActionClient<Int64Value, Int64Value, Int64Value>> action_clients_;

  std::deque<Sample<Int64Value>> kept_;
  std::deque<Subscriber> late_;
  std::deque<Call> calls_;
  std::deque<Responder<Int64Value>> owed_;
  std::deque<Goal> goals_;
  std::int64_t refusals_left_ = 0;
};

/// Publishes from a thread of its own, as fast as its credits allow, and sometimes without asking.
class Driver final : public Component {
 public:
  explicit Driver(Context& context);

 private:
  void drive(const std::stop_token& stop);

  Param<std::int64_t> count_;  ///< Of messages; 0: without end.
  ExternalPublisher<Int64Value> with_credits_;
  ExternalPublisher<Int64Value> without_;
};

/// Never faults: what it publishes, each player that lives must receive.
class Pinger final : public Component {
 public:
  explicit Pinger(Context& context);

  void serve() override;

 private:
  Publisher<Int64Value> ping_;
};

}  // namespace fastcycle::operations
