// Fast DDS within one process, with loans. https://fast-dds.docs.eprosima.com

#include <memory>
#include <thread>

#include <fastrtps/config.h>

#include "peers/common/peer.h"
#include "peers/fastdds/entities.h"
#include "peers/fastdds/receivers.h"

namespace fastcycle::peers {
namespace {

/// How a reader is notified of data.
enum class Telling : std::uint8_t { kWaitset, kListener };

void measure_loans(Run& run, Telling telling) {
  Participant participant(run.size());
  const Link there(run, participant, "payload");
  const Link back(run, participant, "echo");
  there.wait_until_matched();
  back.wait_until_matched();
  const Take take_down = [&](const PlainBytes& message, std::int64_t arrived_ns) {
    run.arrived(message.stamps(), message.data(), arrived_ns);
  };
  const Take answer = [&](const PlainBytes& message, std::int64_t) {
    PlainBytes* loaned = back.loan();
    loaned->set_stamps(message.stamps());
    loaned->data()[0] = message.data()[0];
    loaned->data()[run.size() - 1] = message.data()[run.size() - 1];
    back.writer->write(loaned);
  };
  const auto listen = [&](const Link& link, const Take& take) {
    auto listener = std::make_unique<Listener>(take);
    link.reader->set_listener(listener.get(), dds::StatusMask::data_available());
    return listener;
  };
  std::unique_ptr<Listener> listeners[2];
  std::jthread waiters[2];
  if (telling == Telling::kListener) {
    listeners[0] = listen(there, run.is_rtt() ? answer : take_down);
    listeners[1] = listen(back, take_down);
  } else {
    waiters[0] = start_waiting(run, *there.reader, run.is_rtt() ? answer : take_down);
    waiters[1] = start_waiting(run, *back.reader, take_down);
  }
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    PlainBytes* message = there.loan();
    measure::fill(message->data(), run.size(), number);
    message->set_stamps({.number = number, .made_ns = made_ns, .sent_ns = now_ns()});
    there.writer->write(message);
  });
  there.reader->set_listener(nullptr);
  back.reader->set_listener(nullptr);
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "fastdds",
       .version = FASTRTPS_VERSION_STR,
       .variants = {
           {.name = "waitset",
            .about =
                "Intra-process delivery of loans; a thread waits on a wait set. An answer is a "
                "new loan with the stamps and both ends of the payload.",
            .delivery = Delivery::kBetweenThreads,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) { measure_loans(run, Telling::kWaitset); }},
           {.name = "listener",
            .about =
                "Intra-process delivery of loans; the publisher's thread runs the callback. An "
                "answer is a new loan with the stamps and both ends of the payload.",
            .delivery = Delivery::kPublishersThread,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) { measure_loans(run, Telling::kListener); }}}});
}
