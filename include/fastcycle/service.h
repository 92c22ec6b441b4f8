#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "fastcycle/assert.h"
#include "fastcycle/component.h"
#include "fastcycle/message.h"
#include "fastcycle/publisher.h"
#include "fastcycle/sample.h"
#include "fastcycle/time.h"

namespace fastcycle {

/// How a call ended. All but `kOk` are errors.
enum class CallStatus : std::uint8_t {
  kOk,
  kAbsent,      ///< No component provides the service, or its server has failed.
  kBusy,        ///< Too many calls of this client are open, or too many requests of this server.
  kFaulted,     ///< The server threw, or was restarted, before it answered.
  kLate,        ///< The deadline has passed. A later answer is ignored, and counted.
  kCancelled,   ///< The caller cancelled it.
  kCycle,       ///< The answer would wait for itself; `Reply::error` describes the cycle.
  kRejected,    ///< The server rejected it, with a reason.
  kAborted,     ///< Goals only: the server could not reach the goal.
  kUnanswered,  ///< The server destroyed its responder without an answer.
  kShutdown,    ///< The application is stopping.
};

/// "ok", "absent", "busy", …
[[nodiscard]] const char* to_word(CallStatus status) noexcept;

struct CallOptions;

namespace detail {

class ClientCore;
class ServerCore;
struct Ticket;

}  // namespace detail

/// The result of a call: a value, or an error with its reason.
///
/// @threads  Confined to the callback that receives it; `sample` returns what may be kept.
template <Message T>
class Reply {
 public:
  /// Constructed by FastCycle, for one callback.
  Reply(CallStatus status, std::string_view error, detail::Envelope* envelope)
      : status_(status), error_(error), envelope_(envelope) {}

  /// Whether the call was answered without an error.
  [[nodiscard]] bool ok() const noexcept { return status_ == CallStatus::kOk; }
  /// How the call ended.
  [[nodiscard]] CallStatus status() const noexcept { return status_; }
  /// As text: `"plan_route": late, 100 ms are over`. Empty if there is no error.
  [[nodiscard]] std::string_view error() const noexcept { return error_; }

  /// The answer; of a goal that was cancelled or aborted, the partial result.
  ///
  /// @pre  `has_value()`, which `ok()` implies.
  [[nodiscard]] const T& operator*() const {
    FASTCYCLE_ASSERT(envelope_ != nullptr, "a reply that is read has a value");
    return static_cast<const T&>(*envelope_->payload);
  }
  /// As `*`.
  [[nodiscard]] const T* operator->() const { return &**this; }
  /// Whether there is a value to read.
  [[nodiscard]] bool has_value() const noexcept { return envelope_ != nullptr; }

  /// The answer, to be kept; empty if there is none.
  [[nodiscard]] Sample<T> sample() const {
    return envelope_ == nullptr ? Sample<T>() : detail::share<T>(*envelope_);
  }

 private:
  CallStatus status_;
  std::string_view error_;
  detail::Envelope* envelope_;
};

namespace detail {

/// Identifies a pending request of a server.
struct Ticket {
  ServerCore* server = nullptr;
  std::size_t index = 0;
  std::uint64_t serial = 0;  ///< Distinguishes it from others at that index.
};

using ReplyCallback = std::function<void(CallStatus, std::string_view error, Envelope*)>;
using RequestCallback = std::function<void(Envelope&, const google::protobuf::Message&, Ticket)>;
using CancelCallback = std::function<void(std::uint64_t number)>;

struct GoalCallbacks {
  std::function<void()> on_accepted = {};
  EnvelopeCallback on_feedback = {};
};

ClientCore& create_client(ComponentCore& core, std::string_view name,
                          const google::protobuf::Message& request,
                          const google::protobuf::Message& reply,
                          const google::protobuf::Message* feedback, std::size_t max_open);
PublisherCore& request_publisher(ClientCore& client) noexcept;
std::uint64_t call(ClientCore& client, Envelope* request, const CallOptions& options,
                   ReplyCallback callback, GoalCallbacks goal);
void cancel_call(ClientCore& client, std::uint64_t number);
bool is_call_open(const ClientCore& client, std::uint64_t number) noexcept;

struct ServerSpec {
  const google::protobuf::Message& request;
  const google::protobuf::Message& reply;
  const google::protobuf::Message* feedback = nullptr;
  std::size_t depth = 0;
  bool defers = false;  ///< It may answer in a later activation.
  RequestCallback callback;
  CancelCallback on_cancel = {};
};

ServerCore& create_server(ComponentCore& core, std::string_view name, ServerSpec spec);
bool is_owed(const Ticket& ticket) noexcept;
bool is_cancelling(const Ticket& ticket) noexcept;
std::optional<Time> deadline_of(const Ticket& ticket) noexcept;
PublisherCore& reply_publisher(const Ticket& ticket) noexcept;
PublisherCore& feedback_publisher(const Ticket& ticket) noexcept;
/// Ends the request; takes `reply` over, null sends an empty one. No effect if it is not pending.
void answer(const Ticket& ticket, CallStatus status, std::string_view reason, Envelope* reply,
            PublisherCore* lender) noexcept;
void publish_feedback(const Ticket& ticket, Envelope* feedback, PublisherCore* lender);

/// Access to loans for one caller, which return to their pool if the caller is gone.
struct LoanAccess {
  template <Message T>
  static Loan<T> make(PublisherCore& publisher) {
    return Loan<T>(publisher, take_loan(publisher, true), false);
  }
  template <Message T>
  static Envelope* take(Loan<T>& loan) noexcept {
    return std::exchange(loan.envelope_, nullptr);
  }
  template <Message T>
  static PublisherCore* lender(const Loan<T>& loan) noexcept {
    return loan.publisher_;
  }
};

}  // namespace detail

/// Answers one request. It may be kept, and used in a later activation of the component; one that
/// is destroyed without an answer replies `kUnanswered`.
///
///     auto reply = responder.loan();
///     reply->set_length_m(12.0);
///     responder.answer(std::move(reply));
///
/// @threads  Confined to its component's activations.
/// @realtime `loan` and `answer` allocate nothing after warm-up; `reject` allocates its reason.
template <Message T>
class Responder {
 public:
  /// Constructed by FastCycle, for the callback that receives the request.
  explicit Responder(const detail::Ticket& ticket) : ticket_(ticket) {}
  /// Takes the request over.
  Responder(Responder&& other) noexcept : ticket_(std::exchange(other.ticket_, {})) {}
  /// As if this were destroyed; then takes the request over.
  Responder& operator=(Responder&& other) noexcept {
    if (this != &other) {
      let_go();
      ticket_ = std::exchange(other.ticket_, {});
    }
    return *this;
  }
  Responder(const Responder&) = delete;
  Responder& operator=(const Responder&) = delete;
  ~Responder() { let_go(); }

  /// Whether the caller waits for the answer: false once it was sent, the caller cancelled, or its
  /// deadline has passed.
  [[nodiscard]] bool is_open() const noexcept { return detail::is_owed(ticket_); }
  /// The caller's deadline, if it has one.
  [[nodiscard]] std::optional<Time> deadline() const noexcept {
    return detail::deadline_of(ticket_);
  }

  /// An empty answer to fill in, also if the caller waits no more.
  [[nodiscard]] Loan<T> loan() const {
    FASTCYCLE_ASSERT(ticket_.server != nullptr, "a responder that was moved from answers nothing");
    return detail::LoanAccess::make<T>(detail::reply_publisher(ticket_));
  }
  /// Answers. If the caller waits no more, the answer is only counted.
  void answer(Loan<T> reply) {
    detail::PublisherCore* lender = detail::LoanAccess::lender(reply);
    detail::answer(ticket_, CallStatus::kOk, {}, detail::LoanAccess::take(reply), lender);
  }
  /// As above, with a copy of `reply`.
  void answer(const T& reply) {
    if (is_open()) {
      auto copy = loan();
      copy->CopyFrom(reply);
      answer(std::move(copy));
    }
  }
  /// Replies `kRejected` with this reason.
  void reject(std::string_view reason) {
    detail::answer(ticket_, CallStatus::kRejected, reason, nullptr, nullptr);
  }

  /// For `CallOptions::on_behalf_of`.
  [[nodiscard]] const detail::Ticket& ticket() const noexcept { return ticket_; }

 private:
  void let_go() noexcept {
    detail::answer(std::exchange(ticket_, {}), CallStatus::kUnanswered,
                   "the server let go of the request without an answer", nullptr, nullptr);
  }

  detail::Ticket ticket_;
};

/// Options of one call.
struct CallOptions {
  /// How long the caller waits, from the time of its activation; without it, until the answer
  /// arrives or the application ends.
  std::optional<Duration> deadline = {};
  /// The request whose answer waits for this call, if it is not the one being served, for the
  /// detection of cycles: `responder.ticket()`.
  const detail::Ticket* on_behalf_of = nullptr;
  /// No pending request of this component waits for this call.
  bool is_independent = false;
};

/// Options of one client.
struct ClientOptions {
  std::size_t max_open = 32;  ///< Calls that may be open at once; one more is `kBusy`.
};

/// Options of one service.
struct ServiceOptions {
  /// Requests that may be pending at once; one more is answered `kBusy`.
  std::size_t depth = 16;
};

/// A call in progress. It may be destroyed: the call continues.
///
/// @threads  Confined to its component's activations.
class Call {
 public:
  Call() = default;
  /// Constructed by `Client::call` and `ActionClient::send`.
  Call(detail::ClientCore& client, std::uint64_t number) : client_(&client), number_(number) {}

  /// Whether its callback has not been called yet.
  [[nodiscard]] bool is_open() const noexcept {
    return client_ != nullptr && detail::is_call_open(*client_, number_);
  }
  /// Cancels it: its callback is called with `kCancelled`, in an activation of its own. No effect
  /// on a call that has ended.
  void cancel() {
    if (client_ != nullptr) {
      detail::cancel_call(*client_, number_);
    }
  }

 private:
  detail::ClientCore* client_ = nullptr;
  std::uint64_t number_ = 0;
};

/// A callback for replies.
template <typename F, typename T>
concept ReplyHandler = std::invocable<F&, const Reply<T>&>;

/// Calls a service asynchronously; a callback receives the answer. Nothing blocks meanwhile.
///
///     auto request = client_.loan();
///     request->set_goal("garage");
///     client_.call(std::move(request), {.deadline = 100ms}, [this](const Reply<Route>& reply)
///     {…});
///
/// Every call ends in exactly one reply, in an activation of its own, never within `call`. The only
/// exception are calls of a component that failed or was restarted: the object that would receive
/// the reply is gone.
///
/// Created by `Context::create_client` in a component's constructor, and valid as long as the
/// component.
///
/// @threads  Confined to its component's activations.
/// @realtime As `Publisher`, after warm-up, if the callback captures at most two pointers; nested
///           calls, and errors, may allocate.
template <Message Request, Message T>
class Client {
 public:
  /// Constructed by `Context::create_client`.
  explicit Client(detail::ClientCore& core) : core_(&core) {}

  /// Borrows an empty request to fill in.
  [[nodiscard]] Loan<Request> loan() {
    return detail::LoanAccess::make<Request>(detail::request_publisher(*core_));
  }

  /// Sends `request`; `callback` is called once.
  ///
  /// @pre  `request` was borrowed from this client.
  template <ReplyHandler<T> F>
  Call call(Loan<Request> request, const CallOptions& options, F callback) {
    FASTCYCLE_ASSERT(detail::LoanAccess::lender(request) == &detail::request_publisher(*core_),
                     "a request is sent by the client that lent it");
    return {*core_,
            detail::call(*core_, detail::LoanAccess::take(request), options,
                         [callback = std::move(callback)](CallStatus status, std::string_view error,
                                                          detail::Envelope* envelope) mutable {
                           callback(Reply<T>(status, error, envelope));
                         },
                         {})};
  }
  /// As above, without a deadline.
  template <ReplyHandler<T> F>
  Call call(Loan<Request> request, F callback) {
    return call(std::move(request), CallOptions{}, std::move(callback));
  }

 private:
  detail::ClientCore* core_;
};

template <Message Request, Message T>
Client<Request, T> Context::create_client(std::string_view name) {
  return create_client<Request, T>(name, ClientOptions{});
}

template <Message Request, Message T>
Client<Request, T> Context::create_client(std::string_view name, const ClientOptions& options) {
  return Client<Request, T>(detail::create_client(
      core_, name, Request::default_instance(), T::default_instance(), nullptr, options.max_open));
}

template <Message Request, Message T, typename F>
void Context::create_service(std::string_view name, F callback) {
  create_service<Request, T>(name, ServiceOptions{}, std::move(callback));
}

template <Message Request, Message T, typename F>
void Context::create_service(std::string_view name, const ServiceOptions& options, F callback) {
  FASTCYCLE_REFUSE_COPIED_MESSAGE(F);
  constexpr bool kAnswersAtOnce = std::invocable<F&, const Request&, T&>;
  constexpr bool kKeeps = std::invocable<F&, const Sample<Request>&, Responder<T>>;
  static_assert(kAnswersAtOnce || kKeeps || std::invocable<F&, const Request&, Responder<T>>,
                "a service is f(const Request&, Reply&), or f(const Request&, Responder<Reply>), "
                "or f(const Sample<Request>&, Responder<Reply>)");
  detail::RequestCallback erased;
  if constexpr (kAnswersAtOnce) {
    erased = [callback = std::move(callback)](detail::Envelope&,
                                              const google::protobuf::Message& request,
                                              detail::Ticket ticket) mutable {
      auto reply = detail::LoanAccess::make<T>(detail::reply_publisher(ticket));
      callback(static_cast<const Request&>(request), *reply);
      detail::PublisherCore* lender = detail::LoanAccess::lender(reply);
      detail::answer(ticket, CallStatus::kOk, {}, detail::LoanAccess::take(reply), lender);
    };
  } else {
    erased = [callback = std::move(callback)](detail::Envelope& envelope,
                                              const google::protobuf::Message& request,
                                              detail::Ticket ticket) mutable {
      if constexpr (kKeeps) {
        callback(detail::share<Request>(envelope), Responder<T>(ticket));
      } else {
        callback(static_cast<const Request&>(request), Responder<T>(ticket));
      }
    };
  }
  detail::create_server(core_, name,
                        {.request = Request::default_instance(),
                         .reply = T::default_instance(),
                         .depth = options.depth,
                         .defers = !kAnswersAtOnce,
                         .callback = std::move(erased)});
}

}  // namespace fastcycle
