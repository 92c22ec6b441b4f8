// Cyclone DDS between two threads of one process. https://cyclonedds.io

#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <dds/dds.h>
#include <dds/version.h>

#include "payload.h"
#include "peers/common/peer.h"
#include "peers/common/thread.h"
#include "peers/common/wait.h"

namespace fastcycle::peers {
namespace {

using Payload = fastcycle_peers_CyclonePayload;

/// The handle; throws on an error.
dds_entity_t checked(dds_return_t result, const char* what) {
  if (result < 0) {
    throw std::runtime_error(std::string(what) + ": " + dds_strretcode(-result));
  }
  return result;
}

/// Deleting it deletes all entities created from it.
class Domain {
 public:
  Domain() : domain_(checked(dds_create_domain(0, kConfiguration), "dds_create_domain")) {
    participant = checked(dds_create_participant(0, nullptr, nullptr), "dds_create_participant");
  }
  Domain(const Domain&) = delete;
  Domain& operator=(const Domain&) = delete;
  ~Domain() { dds_delete(domain_); }

  dds_entity_t participant;

 private:
  // Nothing leaves the machine; readers of this process are never served by the network.
  static constexpr const char* kConfiguration =
      "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast><Interfaces>"
      "<NetworkInterface name=\"lo\"/></Interfaces></General></Domain></CycloneDDS>";

  const dds_entity_t domain_;
};

/// A writer and a reader of one topic. Nothing is overwritten: KEEP_ALL, reliable.
struct Link {
  Link(const Domain& domain, const char* name) {
    const std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> qos(dds_create_qos(),
                                                                    dds_delete_qos);
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_SECS(10));
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_ALL, 0);
    const dds_entity_t topic =
        checked(dds_create_topic(domain.participant, &fastcycle_peers_CyclonePayload_desc, name,
                                 qos.get(), nullptr),
                "dds_create_topic");
    reader = checked(dds_create_reader(domain.participant, topic, qos.get(), nullptr),
                     "dds_create_reader");
    writer = checked(dds_create_writer(domain.participant, topic, qos.get(), nullptr),
                     "dds_create_writer");
  }

  void wait_until_matched() const {
    wait_until("writer and reader find each other", [this] {
      dds_publication_matched_status_t status{};
      checked(dds_get_publication_matched_status(writer, &status), "matched status");
      return status.current_count > 0;
    });
  }

  dds_entity_t writer;
  dds_entity_t reader;
};

/// Calls `take(payload, arrived_ns)` for each one until the run has ended. A wait set and a read
/// condition, as in the project's own round-trip example; taken samples are loans of the reader,
/// which reuses their memory.
template <typename Take>
void receive_all(const Run& run, const Domain& domain, dds_entity_t reader, const Take& take) {
  const dds_entity_t waitset = checked(dds_create_waitset(domain.participant), "waitset");
  const dds_entity_t condition =
      checked(dds_create_readcondition(reader, DDS_ANY_STATE), "readcondition");
  checked(dds_waitset_attach(waitset, condition, reader), "dds_waitset_attach");
  constexpr std::size_t kAtOnce = 10;
  void* samples[kAtOnce] = {};
  dds_sample_info_t infos[kAtOnce];
  while (!run.is_over()) {
    dds_attach_t triggered = 0;
    checked(dds_waitset_wait(waitset, &triggered, 1, DDS_MSECS(100)), "dds_waitset_wait");
    const dds_return_t taken =
        checked(dds_take(reader, samples, infos, kAtOnce, kAtOnce), "dds_take");
    const std::int64_t arrived_ns = now_ns();
    for (dds_return_t i = 0; i < taken; ++i) {
      if (infos[i].valid_data) {
        take(*static_cast<const Payload*>(samples[i]), arrived_ns);
      }
    }
    if (taken > 0) {
      checked(dds_return_loan(reader, samples, taken), "dds_return_loan");
    }
  }
}

void measure_threads(Run& run) {
  const Domain domain;
  const Link there(domain, "payload");
  const Link back(domain, "echo");
  there.wait_until_matched();
  back.wait_until_matched();
  std::jthread echo;
  if (run.is_rtt()) {
    echo = start_thread([&] {
      receive_all(run, domain, there.reader,
                  [&](const Payload& payload, std::int64_t) { dds_write(back.writer, &payload); });
    });
  }
  const std::jthread receiver = start_thread([&] {
    receive_all(run, domain, (run.is_rtt() ? back : there).reader,
                [&](const Payload& payload, std::int64_t arrived_ns) {
                  run.arrived({payload.number, payload.made_ns, payload.sent_ns},
                              payload.data._buffer, arrived_ns);
                });
  });
  std::vector<unsigned char> data(run.size());  // dds_write copies: one payload suffices for all.
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    measure::fill(data.data(), data.size(), number);
    const auto length = static_cast<std::uint32_t>(data.size());
    const Payload payload = {
        .number = number,
        .made_ns = made_ns,
        .sent_ns = now_ns(),
        .data = {._maximum = length, ._length = length, ._buffer = data.data(), ._release = false}};
    checked(dds_write(there.writer, &payload), "dds_write");
  });
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "cyclonedds",
       .version = DDS_VERSION,
       .variants = {{.name = "default",
                     .about = "A writer and a reader in one process; a thread waits on "
                              "a wait set and takes by loan.",
                     .delivery = Delivery::kBetweenThreads,
                     .is_typed = true,
                     .copies = "2: into the writer's sample, out of it",
                     .measure = measure_threads,
                     .busy_us_per_mib = 300}}});
}
