// The design described in the paper, with its own message type.

#include <algorithm>
#include <memory>
#include <thread>
#include <utility>

#include "benchmark/payload.pb.h"
#include "peers/common/peer.h"
#include "peers/paper_model/broker.h"

namespace fastcycle::peers::paper_model {
namespace {

using benchmark::Payload;

Stamps stamps_of(const Payload& payload) {
  return {payload.number(), payload.made_ns(), payload.sent_ns()};
}

void measure_model(Run& run, Looking looking) {
  // One pool thread for each core, the usual default; at least two.
  Broker broker(looking, std::max(2U, std::thread::hardware_concurrency()));
  const auto take = [&](const Message& message) {
    const std::int64_t arrived_ns = now_ns();
    const auto& payload = static_cast<const Payload&>(*message);
    run.arrived(stamps_of(payload), payload.data().data(), arrived_ns);
  };
  if (run.is_rtt()) {
    broker.subscribe("echo", take);
    broker.subscribe("payload", [&](const Message& message) { broker.publish("echo", message); });
  } else {
    broker.subscribe("payload", take);
  }
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    auto payload = std::make_shared<Payload>();  // A new one for each message.
    payload->mutable_data()->resize(run.size());
    measure::fill(payload->mutable_data()->data(), run.size(), number);
    payload->set_number(number);
    payload->set_made_ns(made_ns);
    payload->set_sent_ns(now_ns());
    broker.publish("payload", std::move(payload));
  });
}

}  // namespace
}  // namespace fastcycle::peers::paper_model

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "paper_model",
       .version = "1",
       .variants = {
           {.name = "poll",
            .about = "The paper's design; its main thread sleeps 100 us between two looks.",
            .delivery = Delivery::kBetweenThreads,
            .is_typed = true,
            .copies = "none",
            .measure =
                [](Run& run) {
                  paper_model::measure_model(run, paper_model::Looking::kEvery100us);
                }},
           {.name = "notify",
            .about = "The paper's design; its main thread sleeps until a publisher notifies it.",
            .delivery = Delivery::kBetweenThreads,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) {
              paper_model::measure_model(run, paper_model::Looking::kWhenNotified);
            }}}});
}
