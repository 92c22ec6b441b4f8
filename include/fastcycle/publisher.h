#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <utility>

#include "fastcycle/assert.h"
#include "fastcycle/message.h"
#include "fastcycle/sample.h"

namespace fastcycle {

/// What an author may say of one publish.
struct PublishOptions {
  /// When the content was measured. Only for components without subscribers, and for external
  /// publishers; everybody else's messages inherit the origin of what caused them.
  std::optional<Time> taken_at = {};
};

namespace detail {

class PublisherCore;
struct LoanAccess;

Envelope* take_loan(PublisherCore& publisher, bool cleared);
void return_loan(PublisherCore& publisher, Envelope* loan) noexcept;
void publish_loan(PublisherCore& publisher, Envelope* loan, const PublishOptions& options);
void publish_received(PublisherCore& publisher, Envelope* received);
void publish_external(PublisherCore& publisher, Envelope* loan, Time taken_at);
Envelope* take_external_loan(PublisherCore& publisher, bool cleared);
void return_external_loan(PublisherCore& publisher, Envelope* loan) noexcept;
std::size_t ask_credits(PublisherCore& publisher);
std::size_t ask_external_credits(PublisherCore& publisher);
bool wait_for_credit(PublisherCore& publisher, const std::stop_token& stop);

}  // namespace detail

/// A message being written, lent by its publisher's pool and owned by one.
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
    FASTCYCLE_ASSERT(envelope_ != nullptr, "a published loan is not written any more");
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
/// Made by `Context::create_publisher` in a component's constructor, and valid as long as the
/// component is.
///
/// @threads  Confined to its component's activations: `publish` asserts that it is called in one.
/// @realtime After warm-up `loan` and `publish` allocate nothing and take no lock. Their time grows
///           with the number of subscribers and with nothing else; `loan` also clears the message.
template <Message T>
class Publisher {
 public:
  /// Made by `Context::create_publisher`.
  explicit Publisher(detail::PublisherCore& core) : core_(&core) {}

  /// Borrows an empty message to fill in. It never fails: when readers hold every message that the
  /// pool may have, what is lent then is counted as `dropped{pool}` when it is published.
  [[nodiscard]] Loan<T> loan() { return Loan<T>(*core_, detail::take_loan(*core_, true), false); }

  /// Borrows a message with the content that it last had, or an empty one: for payloads that are
  /// overwritten whole, where clearing and filling again would cost twice.
  [[nodiscard]] Loan<T> loan_uncleared() {
    return Loan<T>(*core_, detail::take_loan(*core_, false), false);
  }

  /// Hands `message` to every subscriber. A full queue drops by its own overflow policy and counts
  /// the loss; nothing that a subscriber does makes this fail or wait.
  ///
  /// @pre  `message` was borrowed from this publisher.
  void publish(Loan<T> message, const PublishOptions& options = {}) {
    FASTCYCLE_ASSERT(message.publisher_ == core_,
                     "a loan is published by the publisher that lent it");
    detail::publish_loan(*core_, std::exchange(message.envelope_, nullptr), options);
  }

  /// Forwards a received message: the subscribers of this topic read the very same bytes, with this
  /// publisher's sequence and publish time.
  ///
  /// @pre  `received` holds a message.
  void publish(const Sample<T>& received) {
    FASTCYCLE_ASSERT(static_cast<bool>(received), "a sample that is forwarded holds a message");
    detail::publish_received(*core_, detail::envelope_of(received));
  }

  /// How many messages may be published in this activation so that no subscriber's queue
  /// overflows: what was there when it was asked first, less what was published since. Once it is
  /// zero, `PublisherOptions::on_credits` is called when there are credits again.
  ///
  /// @pre  The publisher has credits: `PublisherOptions::credits`, or `"credits"` of its topic.
  [[nodiscard]] std::size_t credits() { return detail::ask_credits(*core_); }

 private:
  detail::PublisherCore* core_;
};

/// Sends messages from threads that are not FastCycle's own: a driver's receive thread, a callback
/// of a vendor's library. Such topics are inputs of the application, and of every replay of it.
///
/// Made by `Context::create_external_publisher`.
///
/// @threads  Safe, while the component runs; messages published before `start` or after `stop` are
///           counted as `dropped{shutdown}`.
/// @realtime Takes one mutex of its own, which only its own callers and a subscriber that comes or
///           goes take, with priority inheritance.
template <Message T>
class ExternalPublisher {
 public:
  /// Made by `Context::create_external_publisher`.
  explicit ExternalPublisher(detail::PublisherCore& core) : core_(&core) {}

  /// Borrows an empty message to fill in; see `Publisher::loan`.
  [[nodiscard]] Loan<T> loan() {
    return Loan<T>(*core_, detail::take_external_loan(*core_, true), true);
  }
  /// Borrows one with its last content; see `Publisher::loan_uncleared`.
  [[nodiscard]] Loan<T> loan_uncleared() {
    return Loan<T>(*core_, detail::take_external_loan(*core_, false), true);
  }

  /// Hands `message` to every subscriber; `taken_at` says when its content was measured.
  void publish(Loan<T> message, Time taken_at) {
    FASTCYCLE_ASSERT(message.publisher_ == core_,
                     "a loan is published by the publisher that lent it");
    detail::publish_external(*core_, std::exchange(message.envelope_, nullptr), taken_at);
  }

  /// How many messages may be published now so that no subscriber's queue overflows.
  ///
  /// @pre  The publisher has credits: `PublisherOptions::credits`, or `"credits"` of its topic.
  [[nodiscard]] std::size_t credits() { return detail::ask_external_credits(*core_); }

  /// Waits until one message may be published; false if `stop` ended the waiting. Several threads
  /// that share a publisher take turns: what one of them waited for another may use.
  ///
  /// @pre      As `credits`.
  /// @realtime Blocks the thread that calls it, which is not FastCycle's; nobody waits for that
  /// one.
  [[nodiscard]] bool wait_for_credit(const std::stop_token& stop) {
    return detail::wait_for_credit(*core_, stop);
  }

 private:
  detail::PublisherCore* core_;
};

}  // namespace fastcycle
