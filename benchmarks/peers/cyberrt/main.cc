// CyberRT within one process. https://cyber-rt.readthedocs.io

#include <memory>
#include <stdexcept>
#include <string>

#include <cyber/cyber.h>

#include "benchmark/payload.pb.h"
#include "peers/common/peer.h"
#include "peers/common/wait.h"

namespace fastcycle::peers {
namespace {

namespace cyber = apollo::cyber;
using benchmark::Payload;
using PayloadPtr = std::shared_ptr<Payload>;

/// No message of a window is overwritten: by default a reader keeps only the newest one.
cyber::ReaderConfig reader_of(const char* channel) {
  cyber::ReaderConfig config;
  config.channel_name = channel;
  config.pending_queue_size = 2 * static_cast<std::uint32_t>(Run::kWindow);
  return config;
}

void wait_for_reader(cyber::Writer<Payload>& writer) {
  wait_until("somebody reads " + writer.GetChannelName(), [&] { return writer.HasReader(); });
}

/// Writer and readers of one process: the default transport hands over the shared pointer, and a
/// coroutine of the reader, run by the scheduler's threads, calls the callback.
void measure_nodes(Run& run) {
  const auto sender = cyber::CreateNode("sender");
  const auto receiver = cyber::CreateNode("receiver");
  const auto writer = sender->CreateWriter<Payload>("payload");
  const auto echo = receiver->CreateWriter<Payload>("echo");
  const auto take = [&run](const PayloadPtr& payload) {
    const std::int64_t arrived_ns = now_ns();
    run.arrived({payload->number(), payload->made_ns(), payload->sent_ns()}, payload->data().data(),
                arrived_ns);
  };
  const auto send_back = [&echo](const PayloadPtr& payload) { echo->Write(payload); };
  std::shared_ptr<cyber::Reader<Payload>> there;
  std::shared_ptr<cyber::Reader<Payload>> back;
  if (run.is_rtt()) {
    back = sender->CreateReader<Payload>(reader_of("echo"), take);
    there = receiver->CreateReader<Payload>(reader_of("payload"), send_back);
    wait_for_reader(*echo);
  } else {
    there = receiver->CreateReader<Payload>(reader_of("payload"), take);
  }
  wait_for_reader(*writer);
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    auto payload = std::make_shared<Payload>();
    payload->mutable_data()->resize(run.size());
    measure::fill(payload->mutable_data()->data(), run.size(), number);
    payload->set_number(number);
    payload->set_made_ns(made_ns);
    payload->set_sent_ns(now_ns());
    writer->Write(payload);
  });
}

void measure_intra(Run& run) {
  if (!cyber::Init("peer_cyberrt")) {
    throw std::runtime_error("CyberRT does not start; is CYBER_PATH set?");
  }
  measure_nodes(run);
  cyber::Clear();
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(argc, argv,
                   {.name = "cyberrt",
                    .version = "10",
                    .variants = {{.name = "intra",
                                  .about = "Nodes of one process, messages by shared pointer.",
                                  .delivery = Delivery::kBetweenThreads,
                                  .is_typed = true,
                                  .copies = "none",
                                  .measure = measure_intra}}});
}
