#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "fastcycle/service.h"

namespace fastcycle::testing {

/// Runs components without a process, a library or real time: a test feeds them messages, advances
/// their clock, and checks what they published.
///
///     fastcycle::testing::Bench bench;
///     bench.add<SpeedLimiter>("limiter", R"({"params": {"limit_mps": 20}})");
///     auto planned = bench.input<demo::Speed>("planning/speed");
///     auto limited = bench.output<demo::Speed>("control/speed");
///     bench.start();
///
///     planned.publish(speed(33.0));
///
///     EXPECT_EQ(limited.take().at(0).mps(), 20.0);
///
/// Components, inputs and outputs are added before `start`. A published message and all its
/// consequences are served at once, without time advancing; timers run in `advance`.
///
/// @threads  Confined to the test's thread.
/// @errors   std::runtime_error with every error when the components do not fit together or a
///           parameter is wrong.
class Bench {
 public:
  template <Message T>
  class Input;
  template <Message T>
  class Output;
  template <Message T>
  struct Received;
  template <Message Request, Message T>
  class Caller;
  template <Message T>
  class Answer;
  class Stand;

  Bench();
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  /// Stops the components, if `stop` was not called.
  ~Bench();

  /// Adds a component; `configuration` is its entry in the application file without name and
  /// library: "params", "serve_period_ms", "subscribers", "remap", "on_fault", …
  template <std::derived_from<Component> T>
  void add(const std::string& name, std::string_view configuration = "{}") {
    add_class(name, configuration,
              {name.c_str(), &detail::create_component<T>, &detail::destroy_component<T>});
  }

  /// Merges other parts of an application file, such as "topics" and "shared_params".
  void configure(std::string_view application);

  /// A topic that the test publishes on.
  template <Message T>
  [[nodiscard]] Input<T> input(const std::string& topic);

  /// A topic that the test subscribes to; every message is kept until it is taken.
  template <Message T>
  [[nodiscard]] Output<T> output(const std::string& topic);

  /// A service that the test calls.
  template <Message Request, Message T>
  [[nodiscard]] Caller<Request, T> client(const std::string& name);

  /// A service that the test provides, by `f(const Request&, Reply&)` or
  /// `f(const Request&, Responder<Reply>)`. A responder that is kept answers within `Stand::run`.
  template <Message Request, Message T, typename F>
  Stand service(const std::string& name, F f);

  /// Constructs, connects and starts everything.
  void start();

  /// Moves the clock by `span`, serving every timer on the way at its time.
  void advance(Duration span);

  /// Switches the application to the mode `mode`, and serves what follows; see `configure` for
  /// "modes" and "initial_mode".
  void switch_mode(const std::string& mode);
  /// The mode that the application is in.
  [[nodiscard]] std::string mode() const;

  /// Activates component `name` alone, regardless of the modes.
  void activate(const std::string& name);
  /// Deactivates component `name` alone, regardless of the modes.
  void deactivate(const std::string& name);
  /// Whether component `name` is active.
  [[nodiscard]] bool is_active(const std::string& name) const;

  /// Changes parameters in a transaction, and serves what follows from it: all of them, or none and
  /// the result has the errors.
  ParamsResult change_params(const std::vector<ParamChange>& changes);

  /// Stops the components in order and destroys them.
  void stop();

  /// The bench's time: `kSimulatedStart` at first; only `advance` moves it.
  [[nodiscard]] Time now() const;

  /// The value that component `name` reported as `result`. @pre It did.
  [[nodiscard]] ReportValue result(const std::string& name, const std::string& result) const;

  /// The faults of component `name`, as text.
  [[nodiscard]] std::vector<std::string> faults(const std::string& name) const;

 private:
  struct State;

  void add_class(const std::string& name, std::string_view configuration,
                 const ComponentClass& component_class);
  [[nodiscard]] Component& component(const std::string& name) const;
  /// Runs `step` when all components are constructed.
  void prepare(std::function<void()> step);
  void run_in(const std::string& name, std::function<void()> body);
  [[nodiscard]] std::string next_name(std::string_view kind);

  std::unique_ptr<State> state_;
};

namespace detail_testing {

template <Message T>
class Feeder final : public Component {
 public:
  explicit Feeder(Context& context)
      : Component(context),
        publisher_(context.create_publisher<T>(context.param<std::string>("topic").get())) {}

  void publish(const T& message, const PublishOptions& options) {
    auto loan = publisher_.loan();
    loan->CopyFrom(message);
    publisher_.publish(std::move(loan), options);
  }

 private:
  Publisher<T> publisher_;
};

template <Message T>
class Collector final : public Component {
 public:
  explicit Collector(Context& context) : Component(context) {
    context.create_subscriber<T>(context.param<std::string>("topic").get(), {.depth = 65536},
                                 [this](const Sample<T>& sample) {
                                   messages.push_back(*sample);
                                   infos.push_back(sample.info());
                                 });
  }

  std::vector<T> messages;
  std::vector<MessageInfo> infos;  ///< Of each of them.
};

template <Message Request, Message T>
class Asker final : public Component {
 public:
  explicit Asker(Context& context)
      : Component(context),
        client(context.create_client<Request, T>(context.param<std::string>("service").get(),
                                                 {.max_open = 256})) {}

  Client<Request, T> client;
};

template <Message Request, Message T>
class Server final : public Component {
 public:
  explicit Server(Context& context) : Component(context) {
    context.create_service<Request, T>(context.param<std::string>("service").get(), {.depth = 256},
                                       [this](const Request& request, Responder<T> responder) {
                                         handler(request, std::move(responder));
                                       });
  }

  std::function<void(const Request&, Responder<T>)> handler;
};

}  // namespace detail_testing

/// A test's publisher. Valid as long as its bench.
template <Message T>
class Bench::Input {
 public:
  /// Publishes `message` now, and serves what follows from it.
  void publish(const T& message, const PublishOptions& options = {}) {
    auto& feeder = static_cast<detail_testing::Feeder<T>&>(bench_->component(name_));
    bench_->run_in(name_, [&] { feeder.publish(message, options); });
  }

 private:
  friend class Bench;
  Input(Bench& bench, std::string name) : bench_(&bench), name_(std::move(name)) {}

  Bench* bench_;
  std::string name_;
};

/// A message that a test received, with its metadata.
template <Message T>
struct Bench::Received {
  T message;         ///< A copy.
  MessageInfo info;  ///< Publish time, publisher and origin.
};

/// A test's subscriber. Valid as long as its bench.
template <Message T>
class Bench::Output {
 public:
  /// The messages since the last call, oldest first.
  [[nodiscard]] std::vector<T> take() {
    auto& collector = static_cast<detail_testing::Collector<T>&>(bench_->component(name_));
    collector.infos.clear();
    return std::exchange(collector.messages, {});
  }

  /// The same, each with its `MessageInfo`:
  ///
  ///     const auto limited = output.take_with_info().at(0);
  ///     EXPECT_EQ(limited.message.mps(), 20.0);
  ///     EXPECT_EQ(limited.info.origin.taken, taken);
  [[nodiscard]] std::vector<Received<T>> take_with_info() {
    auto& collector = static_cast<detail_testing::Collector<T>&>(bench_->component(name_));
    std::vector<Received<T>> all;
    for (std::size_t i = 0; i < collector.messages.size(); ++i) {
      all.push_back({std::move(collector.messages[i]), collector.infos[i]});
    }
    collector.messages.clear();
    collector.infos.clear();
    return all;
  }

 private:
  friend class Bench;
  Output(Bench& bench, std::string name) : bench_(&bench), name_(std::move(name)) {}

  Bench* bench_;
  std::string name_;
};

/// A service that a test provides. Valid as long as its bench.
class Bench::Stand {
 public:
  /// Calls `body` in an activation of the service, and serves what follows from it.
  void run(std::function<void()> body) { bench_->run_in(name_, std::move(body)); }

 private:
  friend class Bench;
  Stand(Bench& bench, std::string name) : bench_(&bench), name_(std::move(name)) {}

  Bench* bench_;
  std::string name_;
};

/// The result of one call of a test.
template <Message T>
class Bench::Answer {
 public:
  /// Whether the reply has arrived.
  [[nodiscard]] bool is_done() const { return state_->is_done; }
  /// Whether the reply has arrived without an error.
  [[nodiscard]] bool ok() const { return is_done() && status() == CallStatus::kOk; }
  /// @pre  `is_done()`
  [[nodiscard]] CallStatus status() const { return state_->status; }
  /// As text; empty if there is no error.
  [[nodiscard]] const std::string& error() const { return state_->error; }
  /// @pre  `ok()`
  [[nodiscard]] const T& operator*() const { return state_->value; }
  /// As `*`.
  [[nodiscard]] const T* operator->() const { return &state_->value; }

  /// Cancels the call, and serves what follows from it.
  void cancel() {
    bench_->run_in(name_, [state = state_] { state->call.cancel(); });
  }

 private:
  template <Message, Message>
  friend class Bench::Caller;
  struct State {
    bool is_done = false;
    CallStatus status = CallStatus::kOk;
    std::string error = {};
    T value = {};
    Call call = {};
  };
  Answer(Bench& bench, std::string name) : bench_(&bench), name_(std::move(name)) {}

  Bench* bench_;
  std::string name_;
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

/// A test's client of a service. Valid as long as its bench.
template <Message Request, Message T>
class Bench::Caller {
 public:
  /// Calls now, and serves what follows from it; the answer may come later.
  Answer<T> call(const Request& request, const CallOptions& options = {}) {
    auto& asker = static_cast<detail_testing::Asker<Request, T>&>(bench_->component(name_));
    Answer<T> answer(*bench_, name_);
    bench_->run_in(name_, [&asker, &request, &options, state = answer.state_] {
      auto loan = asker.client.loan();
      loan->CopyFrom(request);
      state->call = asker.client.call(std::move(loan), options, [state](const Reply<T>& reply) {
        state->is_done = true;
        state->status = reply.status();
        state->error = reply.error();
        if (reply.has_value()) {
          state->value = *reply;
        }
      });
    });
    return answer;
  }

 private:
  friend class Bench;
  Caller(Bench& bench, std::string name) : bench_(&bench), name_(std::move(name)) {}

  Bench* bench_;
  std::string name_;
};

template <Message Request, Message T>
Bench::Caller<Request, T> Bench::client(const std::string& name) {
  const std::string its_name = next_name("client");
  add<detail_testing::Asker<Request, T>>(its_name, R"({"params": {"service": ")" + name + R"("}})");
  return {*this, its_name};
}

template <Message Request, Message T, typename F>
Bench::Stand Bench::service(const std::string& name, F f) {
  using Server = detail_testing::Server<Request, T>;
  const std::string its_name = next_name("service");
  add<Server>(its_name, R"({"params": {"service": ")" + name + R"("}})");
  prepare([this, its_name, f = std::move(f)]() mutable {
    auto& server = static_cast<Server&>(component(its_name));
    if constexpr (std::invocable<F&, const Request&, Responder<T>>) {
      server.handler = std::move(f);
    } else {
      server.handler = [f = std::move(f)](const Request& request, Responder<T> responder) mutable {
        auto reply = responder.loan();
        f(request, *reply);
        responder.answer(std::move(reply));
      };
    }
  });
  return {*this, its_name};
}

template <Message T>
Bench::Input<T> Bench::input(const std::string& topic) {
  const std::string name = next_name("input");
  add<detail_testing::Feeder<T>>(name, R"({"params": {"topic": ")" + topic + R"("}})");
  return {*this, name};
}

template <Message T>
Bench::Output<T> Bench::output(const std::string& topic) {
  const std::string name = next_name("output");
  add<detail_testing::Collector<T>>(name, R"({"params": {"topic": ")" + topic + R"("}})");
  return {*this, name};
}

}  // namespace fastcycle::testing
