#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <utility>

#include "fastcycle/assert.h"
#include "fastcycle/message.h"
#include "fastcycle/sample.h"

namespace fastcycle {

/// Options of one publish.
struct PublishOptions {
  /// When the content was measured: the message begins a chain of its own and inherits nothing.
  /// Without it, the message inherits the origin of its cause; without a cause, its origin is the
  /// time of the activation, or for an external publisher the time of the publish.
  std::optional<Time> taken_at = {};
};

namespace detail {

class PublisherCore;
struct LoanAccess;

Envelope* take_loan(PublisherCore& publisher, bool cleared);
void return_loan(PublisherCore& publisher, Envelope* loan) noexcept;
void publish_loan(PublisherCore& publisher, Envelope* loan, const PublishOptions& options);
void publish_received(PublisherCore& publisher, Envelope* received, Holder holder);
void publish_external(PublisherCore& publisher, Envelope* loan, Time taken_at);
Envelope* take_external_loan(PublisherCore& publisher, bool cleared);
void return_external_loan(PublisherCore& publisher, Envelope* loan) noexcept;
std::size_t ask_credits(PublisherCore& publisher);
std::size_t ask_external_credits(PublisherCore& publisher);
bool wait_for_credit(PublisherCore& publisher, const std::stop_token& stop);
std::size_t count_subscribers(const PublisherCore& publisher);
std::size_t count_external_subscribers(PublisherCore& publisher);
Time now_of(const PublisherCore& publisher) noexcept;
[[noreturn]] void used_spent_loan(const PublisherCore& publisher) noexcept;
[[noreturn]] void used_strange_loan(const PublisherCore& publisher,
                                    const PublisherCore& lender) noexcept;
[[noreturn]] void forwarded_nothing(const PublisherCore& publisher) noexcept;

}  // namespace detail

/// A message being written, lent by its publisher's pool, with a single owner.
///
/// A loan that is never published goes back to the pool on its own.
///
/// @threads  Confined to the thread that borrowed it.
template <Message T>
class Loan {
 public:
  /// Takes the loan over.
  Loan(Loan&& other) noexcept
      : publisher_(other.publisher_),
        envelope_(std::exchange(other.envelope_, nullptr)),
        is_external_(other.is_external_) {}
  Loan(const Loan&) = delete;
  Loan& operator=(const Loan&) = delete;
  Loan& operator=(Loan&&) = delete;
  ~Loan() {
    if (envelope_ == nullptr) {
      return;
    }
    if (is_external_) {
      detail::return_external_loan(*publisher_, envelope_);
    } else {
      detail::return_loan(*publisher_, envelope_);
    }
  }

  /// The message to fill in. @pre It was not published.
  [[nodiscard]] T& operator*() const {
    if (envelope_ == nullptr) [[unlikely]] {
      detail::used_spent_loan(*publisher_);
    }
    return static_cast<T&>(*envelope_->own);
  }
  /// As `*`.
  [[nodiscard]] T* operator->() const { return &**this; }

 private:
  template <Message>
  friend class Publisher;
  template <Message>
  friend class ExternalPublisher;
  friend struct detail::LoanAccess;

  Loan(detail::PublisherCore& publisher, detail::Envelope* envelope, bool is_external)
      : publisher_(&publisher), envelope_(envelope), is_external_(is_external) {}

  /// Ends the process unless `publisher` may publish it.
  void check_for(const detail::PublisherCore& publisher) const {
    if (publisher_ != &publisher) [[unlikely]] {
      detail::used_strange_loan(publisher, *publisher_);
    }
    if (envelope_ == nullptr) [[unlikely]] {
      detail::used_spent_loan(*publisher_);
    }
  }

  detail::PublisherCore* publisher_;
  detail::Envelope* envelope_;
  bool is_external_;
};

/// Sends messages of type `T` to one topic.
///
/// A message is written once, into memory lent by the publisher's pool, and every subscriber reads
/// that same memory:
///
///     auto state = publisher_.loan();
///     state->set_speed_mps(13.9);
///     publisher_.publish(std::move(state));
///
/// Created by `Context::create_publisher` in a component's constructor, and valid as long as the
/// component.
///
/// @threads  Confined to its component's activations: a call elsewhere ends the process with a
///           message. Other threads publish by an `ExternalPublisher`.
/// @realtime After warm-up `loan` and `publish` allocate nothing and take no lock. Their time
///           depends on the number of subscribers only; `loan` also clears the message.
template <Message T>
class Publisher {
 public:
  /// Constructed by `Context::create_publisher`.
  explicit Publisher(detail::PublisherCore& core) : core_(&core) {}

  /// Borrows an empty message to fill in. If readers hold every message that the pool may have, the
  /// message is not delivered: its publish is counted as `dropped{pool}`.
  ///
  /// @errors Throws `std::length_error` if the component holds more loans than the pool may have
  ///         messages: it keeps loans that it neither publishes nor destroys.
  [[nodiscard]] Loan<T> loan() { return Loan<T>(*core_, detail::take_loan(*core_, true), false); }

  /// Borrows a message with its last content, or an empty one: for payloads that are overwritten
  /// entirely, to save the cost of clearing.
  [[nodiscard]] Loan<T> loan_uncleared() {
    return Loan<T>(*core_, detail::take_loan(*core_, false), false);
  }

  /// Hands `message` to every subscriber. A full queue drops by its own overflow policy and counts
  /// the loss; a subscriber can never make this fail or block.
  ///
  /// @pre  `message` was borrowed from this publisher.
  void publish(Loan<T> message, const PublishOptions& options = {}) {
    message.check_for(*core_);
    detail::publish_loan(*core_, std::exchange(message.envelope_, nullptr), options);
  }

  /// Forwards a received message: the subscribers of this topic read the very same bytes, with this
  /// publisher's sequence and publish time.
  ///
  /// @pre  `received` holds a message.
  void publish(const Sample<T>& received) {
    if (!received) [[unlikely]] {
      detail::forwarded_nothing(*core_);
    }
    detail::publish_received(*core_, detail::envelope_of(received), detail::holder_of(received));
  }

  /// How many messages may be published in this activation so that no subscriber's queue overflows:
  /// the credits at the first call, less the messages published since. Once it was zero,
  /// `PublisherOptions::on_credits` is called when credits are available again.
  ///
  /// @pre  The publisher has credits: `PublisherOptions::credits`, or `"credits"` of its topic.
  [[nodiscard]] std::size_t credits() { return detail::ask_credits(*core_); }

  /// How many subscriptions of components are connected, views and those of synchronizers included:
  /// to skip work without a consumer. Recorders and tools are not counted. Components that
  /// subscribe or unsubscribe while they run change it, in simulated time in the same round in
  /// every run; otherwise it is fixed when the application starts. A replay counts only the
  /// components that run in it: what a component publishes should not depend on it.
  [[nodiscard]] std::size_t subscriber_count() const { return detail::count_subscribers(*core_); }

 private:
  detail::PublisherCore* core_;
};

/// Sends messages from threads outside of FastCycle: a driver's receive thread, a callback of a
/// vendor's library. Such topics are inputs of the application, and of every replay of it.
///
/// Created by `Context::create_external_publisher`.
///
/// @threads  Safe, while the component runs; messages published before `start` or after `stop` are
///           counted as `dropped{shutdown}`.
/// @realtime Locks one mutex with priority inheritance, which only its callers and subscribers that
///           are added or removed contend for.
template <Message T>
class ExternalPublisher {
 public:
  /// Constructed by `Context::create_external_publisher`.
  explicit ExternalPublisher(detail::PublisherCore& core) : core_(&core) {}

  /// Borrows an empty message to fill in; see `Publisher::loan`.
  [[nodiscard]] Loan<T> loan() {
    return Loan<T>(*core_, detail::take_external_loan(*core_, true), true);
  }
  /// Borrows one with its last content; see `Publisher::loan_uncleared`.
  [[nodiscard]] Loan<T> loan_uncleared() {
    return Loan<T>(*core_, detail::take_external_loan(*core_, false), true);
  }

  /// Hands `message` to every subscriber, measured at `options.taken_at`, else now.
  void publish(Loan<T> message, const PublishOptions& options = {}) {
    publish(std::move(message), options.taken_at ? *options.taken_at : now());
  }
  /// As above.
  void publish(Loan<T> message, Time taken_at) {
    message.check_for(*core_);
    detail::publish_external(*core_, std::exchange(message.envelope_, nullptr), taken_at);
  }

  /// How many messages may be published now so that no subscriber's queue overflows.
  ///
  /// @pre  The publisher has credits: `PublisherOptions::credits`, or `"credits"` of its topic.
  [[nodiscard]] std::size_t credits() { return detail::ask_external_credits(*core_); }

  /// See `Publisher::subscriber_count`.
  [[nodiscard]] std::size_t subscriber_count() const {
    return detail::count_external_subscribers(*core_);
  }

  /// The application's current time, for `taken_at`. It follows wall time unless the run is
  /// simulated or has another speed; simulated time advances unless a `TimeHold` is held.
  [[nodiscard]] Time now() const noexcept { return detail::now_of(*core_); }

  /// Waits until one message may be published; false if `stop` ended the wait. If several threads
  /// share a publisher, another one may use the credit that one of them waited for.
  ///
  /// @pre      As `credits`.
  /// @realtime Blocks the calling thread, for which no thread of FastCycle waits.
  [[nodiscard]] bool wait_for_credit(const std::stop_token& stop) {
    return detail::wait_for_credit(*core_, stop);
  }

 private:
  detail::PublisherCore* core_;
};

}  // namespace fastcycle
