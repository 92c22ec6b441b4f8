// Implements the functions of include/fastcycle/publisher.h: calls of components and threads.

#include <mutex>

#include <fmt/format.h>

#include "broker/activation_check.h"
#include "broker/publisher_core.h"
#include "broker/topic.h"
#include "fastcycle/publisher.h"

namespace fastcycle::detail {
namespace {

/// The result of `find()`. An external publisher is called by foreign threads; a call within an
/// activation is recorded, and returns the same in a replay.
template <typename Find>
std::uint64_t learn_if_activated(const PublisherCore& publisher, ReadKind kind, const Find& find) {
  return publisher.owner.is_active_here() ? publisher.owner.learn(kind, publisher.id, find)
                                          : static_cast<std::uint64_t>(find());
}

}  // namespace

Envelope* take_loan(PublisherCore& publisher, bool cleared) {
  if (!is_in_activation_of(publisher.owner)) [[unlikely]] {
    called_outside(publisher.owner, "loan() for", publisher.topic.name, kPublishFromThreads);
  }
  if (publisher.owner.replayed != nullptr) [[unlikely]] {
    publisher.check_replayed_loan();
  }
  return publisher.loan(cleared);
}

void return_loan(PublisherCore& publisher, Envelope* loan) noexcept {
  publisher.return_loan(loan);
}

void publish_loan(PublisherCore& publisher, Envelope* loan, const PublishOptions& options) {
  publisher.publish(loan, options);
}

void publish_received(PublisherCore& publisher, Envelope* received, Holder holder) {
  publisher.forward(received, holder);
}

Envelope* take_external_loan(PublisherCore& publisher, bool cleared) {
  const std::lock_guard lock(publisher.mutex());
  return publisher.loan(cleared);
}

void return_external_loan(PublisherCore& publisher, Envelope* loan) noexcept {
  const std::lock_guard lock(publisher.mutex());
  publisher.return_loan(loan);
}

std::size_t ask_credits(PublisherCore& publisher) {
  return publisher.ask_credits();
}

std::size_t ask_external_credits(PublisherCore& publisher) {
  return learn_if_activated(publisher, ReadKind::kCredits,
                            [&] { return publisher.ask_external_credits(); });
}

bool wait_for_credit(PublisherCore& publisher, const std::stop_token& stop) {
  return learn_if_activated(publisher, ReadKind::kCredits,
                            [&] { return publisher.wait_for_credit(stop); }) != 0;
}

std::size_t count_subscribers(const PublisherCore& publisher) {
  if (!is_in_activation_of(publisher.owner)) [[unlikely]] {
    called_outside(publisher.owner, "subscriber_count() of", publisher.topic.name,
                   "an ExternalPublisher can be asked by your own thread");
  }
  return publisher.owner.learn(ReadKind::kSubscribers, publisher.id,
                               [&] { return publisher.count_subscribers(); });
}

std::size_t count_external_subscribers(PublisherCore& publisher) {
  return learn_if_activated(publisher, ReadKind::kSubscribers, [&] {
    const std::lock_guard lock(publisher.mutex());
    return publisher.count_subscribers();
  });
}

Time now_of(const PublisherCore& publisher) noexcept {
  const PublishingComponent& owner = publisher.owner;
  return owner.is_active_here() ? owner.now : owner.clock->now();
}

void used_spent_loan(const PublisherCore& publisher) noexcept {
  broke_contract(publisher.owner,
                 fmt::format("a loan for \"{}\" is used after it was published, or moved from",
                             publisher.topic.name),
                 "borrow another one with loan()");
}

void used_strange_loan(const PublisherCore& publisher, const PublisherCore& lender) noexcept {
  broke_contract(publisher.owner,
                 fmt::format("a loan for \"{}\" is published on \"{}\"", lender.topic.name,
                             publisher.topic.name),
                 "publish it by the publisher that lent it, or forward a received message as a "
                 "Sample");
}

void forwarded_nothing(const PublisherCore& publisher) noexcept {
  broke_contract(
      publisher.owner,
      fmt::format("a sample without a message is forwarded on \"{}\"", publisher.topic.name),
      "test the sample before");
}

void publish_external(PublisherCore& publisher, Envelope* loan, Time taken_at) {
  publisher.publish_external(loan, taken_at);
}

}  // namespace fastcycle::detail
