// iceoryx between two processes, with iox-roudi beside them. https://iceoryx.io

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <iceoryx_hoofs/log/logmanager.hpp>
#include <iceoryx_posh/popo/untyped_publisher.hpp>
#include <iceoryx_posh/popo/untyped_subscriber.hpp>
#include <iceoryx_posh/popo/wait_set.hpp>
#include <iceoryx_posh/runtime/posh_runtime.hpp>
#include <iceoryx_versions.hpp>
#include <unistd.h>

#include "peers/common/peer.h"
#include "peers/common/plain_message.h"
#include "peers/common/thread.h"
#include "peers/common/wait.h"

namespace fastcycle::peers {
namespace {

using iox::popo::UntypedPublisher;
using iox::popo::UntypedSubscriber;

constexpr std::uint32_t kAlignment = alignof(PlainMessage);
constexpr std::size_t kLargest = 4 << 20;

/// One runtime for each process, with its own name.
void join_system(const char* role) {
  iox::log::LogManager::GetLogManager().SetDefaultLogLevel(iox::log::LogLevel::kError,
                                                           iox::log::LogLevelOutput::kHideLogLevel);
  const std::string name = std::string("peer_") + role + "_" + std::to_string(getpid());
  iox::runtime::PoshRuntime::initRuntime({iox::cxx::TruncateToCapacity, name});
}

iox::capro::ServiceDescription service(const char* topic) {
  return {"fastcycle", "benchmark", {iox::cxx::TruncateToCapacity, std::string(topic)}};
}

/// "To ensure that samples are never lost, you have the possibility to busy-wait for the subscriber
/// when publishing. Both publisher and subscriber have to request compatible policies"
/// (iceoptions).
iox::popo::PublisherOptions publisher_options() {
  iox::popo::PublisherOptions options;
  options.subscriberTooSlowPolicy = iox::popo::ConsumerTooSlowPolicy::WAIT_FOR_CONSUMER;
  return options;
}

iox::popo::SubscriberOptions subscriber_options(std::size_t size) {
  iox::popo::SubscriberOptions options;
  options.queueFullPolicy = iox::popo::QueueFullPolicy::BLOCK_PRODUCER;
  constexpr std::size_t kSmall = 4096;
  options.queueCapacity = size < kSmall ? 256 : 8;  // 256 is the most; roudi.toml has the chunks.
  return options;
}

void wait_for_subscriber(const UntypedPublisher& publisher) {
  wait_until("there is a subscriber", [&] { return publisher.hasSubscribers(); });
}

/// Calls `take(message)` for each message until the run has ended. The wait set reports events, and
/// all available messages are taken for each: "with an event the user is notified once per event,
/// and ... should acquire all data" (waitset example).
template <typename Take>
void receive_all(const Run& run, UntypedSubscriber& subscriber, const Take& take) {
  iox::popo::WaitSet<1> waitset;
  waitset.attachEvent(subscriber, iox::popo::SubscriberEvent::DATA_RECEIVED).or_else([](auto&) {
    throw std::runtime_error("the wait set takes no subscriber");
  });
  while (!run.is_over()) {
    // A message may have arrived before the subscriber was attached: take first, then wait.
    while (true) {
      auto chunk = subscriber.take();
      if (chunk.has_error()) {
        break;
      }
      take(*static_cast<const PlainMessage*>(chunk.value()));
      subscriber.release(chunk.value());
    }
    waitset.timedWait(iox::units::Duration::fromMilliseconds(100));
  }
  waitset.detachEvent(subscriber, iox::popo::SubscriberEvent::DATA_RECEIVED);
}

PlainMessage* loan(UntypedPublisher& publisher, std::size_t size) {
  auto chunk = publisher.loan(static_cast<std::uint32_t>(PlainMessage::bytes(size)), kAlignment);
  if (chunk.has_error()) {
    throw std::runtime_error("no chunk to borrow: iox-roudi has too few of this size");
  }
  return new (chunk.value()) PlainMessage;
}

void take_down(Run& run, UntypedSubscriber& subscriber) {
  receive_all(run, subscriber, [&](const PlainMessage& message) {
    const std::int64_t arrived_ns = now_ns();
    run.arrived(message.stamps, message.data(), arrived_ns);
  });
}

void receive_in_second_process(Run& run) {
  join_system("subscriber");
  UntypedSubscriber subscriber(service("payload"), subscriber_options(run.size()));
  std::optional<UntypedPublisher> echo;
  if (run.is_rtt()) {
    echo.emplace(service("echo"), publisher_options());
    wait_for_subscriber(*echo);
  }
  wait_until("there is a publisher",
             [&] { return subscriber.getSubscriptionState() == iox::SubscribeState::SUBSCRIBED; });
  run.set_second_ready();
  if (!echo) {
    take_down(run, subscriber);
    return;
  }
  receive_all(run, subscriber, [&](const PlainMessage& message) {
    PlainMessage* answer = loan(*echo, run.size());
    answer_with(*answer, message, run.size());
    echo->publish(answer);
  });
}

void measure_waitset(Run& run) {
  if (run.size() > kLargest) {
    throw std::runtime_error("roudi.toml has chunks for payloads of up to 4 MiB only");
  }
  run.holds_back_by_itself();
  run.in_second_process([&] { receive_in_second_process(run); });
  join_system("publisher");
  UntypedPublisher publisher(service("payload"), publisher_options());
  std::optional<UntypedSubscriber> echo;
  std::jthread receiver;
  if (run.is_rtt()) {
    echo.emplace(service("echo"), subscriber_options(run.size()));
    receiver = start_thread([&] { take_down(run, *echo); });
  }
  run.wait_for_second_ready();
  wait_for_subscriber(publisher);
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    PlainMessage* message = loan(publisher, run.size());
    measure::fill(message->data(), run.size(), number);
    message->stamps = {.number = number, .made_ns = made_ns, .sent_ns = now_ns()};
    publisher.publish(message);
  });
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "iceoryx",
       .version = ICEORYX_LATEST_RELEASE_VERSION,
       .variants = {{.name = "waitset",
                     .about =
                         "Two processes, loaned chunks of shared memory, a wait set; an answer "
                         "is a new chunk with the stamps and both ends of the payload.",
                     .delivery = Delivery::kBetweenProcesses,
                     .is_typed = false,
                     .copies = "none",
                     .measure = measure_waitset,
                     .daemon = "roudi"}}});
}
