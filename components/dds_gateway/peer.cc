// Another process in the network of a test, with an engine of its own and nothing of FastCycle's:
//
//     dds_gateway_peer ENGINE DOMAIN INTERFACE [secured ENCLAVE] WHAT...
//
//     echo IN OUT TYPE RELIABILITY DURABILITY [DEPTH]         sends back what it gets
//     send OUT TYPE RELIABILITY DURABILITY COUNT FILE         sends the bytes of FILE so often
//     play OUT TYPE RELIABILITY DURABILITY PERIOD_MS FILE...  sends each file once, whose header
//                                                             then says that 0.1 s ago it began
//     keep IN TYPE RELIABILITY DURABILITY FOLDER              writes what it gets into files
//     serve SERVICE                                           is a server of std_srvs/srv/SetBool
//     ask SERVICE COUNT                                       is a client of it
//     come_and_go OUT TYPE COUNT                              is so many participants, one by one
//
// IN, OUT and TYPE are names of DDS, SERVICE is one of ROS 2. All print on standard output when
// they are ready; all but `come_and_go` end at the end of standard input. `send` and `play` begin
// once a reader was found. `echo` prints at its end what it received, and how many readers and
// writers it has found; `ask` prints how many answers were right, as soon as it has them.
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "dds_gateway/engine.h"
#include "dds_gateway/ros_graph.h"
#include "ros2/cdr.h"
#include "ros2/names.h"

namespace {

using namespace std::chrono_literals;
using namespace fastcycle::dds_gateway;
using fastcycle::ros2::Buffer;
using fastcycle::ros2::CdrReader;
using fastcycle::ros2::CdrWriter;

Qos qos_of(const std::string& reliability, const std::string& durability, std::size_t depth) {
  return {.is_reliable = reliability == "reliable",
          .is_transient_local = durability == "transient_local",
          .depth = depth};
}

Buffer buffer_of(std::span<const std::byte> bytes) {
  Buffer buffer;
  std::memcpy(buffer.grow(bytes.size()), bytes.data(), bytes.size());
  return buffer;
}

/// Serves until standard input ends.
void serve(Participant& participant) {
  std::atomic<bool> has_ended{false};
  std::jthread input([&] {
    char byte = 0;
    while (read(STDIN_FILENO, &byte, 1) > 0) {
    }
    has_ended = true;
    participant.wake();
  });
  while (!has_ended) {
    participant.serve(1s);
    (void)participant.discoveries();
  }
}

void announce(Participant& participant, Writer& graph, const Reader* reader, const Writer* writer) {
  NodeEntities node;
  node.name = "peer";
  if (reader != nullptr) {
    node.readers.push_back(reader->guid());
  }
  if (writer != nullptr) {
    node.writers.push_back(writer->guid());
  }
  Buffer message;
  write_graph(participant.guid(), {node}, message);
  graph.write(message);
}

void print_ready() {
  fmt::print("ready\n");
  std::fflush(stdout);
}

std::string read_file(const std::string& name) {
  std::ifstream file(name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Shared by all modes.
struct Peer {
  Participant& participant;
  Writer& graph;
  std::vector<std::string> args;  // From the mode on.
};

/// The ends of what `args` names from `at` on: a topic, its type and its quality of service.
Endpoint endpoint_of(const Peer& peer, std::size_t at, bool is_reader) {
  return {.topic = peer.args.at(at),
          .type = peer.args.at(at + 1),
          .user_data = "",
          .qos = qos_of(peer.args.at(at + 2), peer.args.at(at + 3), 1000),
          .is_reader = is_reader};
}

void echo(const Peer& peer) {
  const std::vector<std::string>& args = peer.args;
  Endpoint out = endpoint_of(peer, 2, false);
  out.qos.depth = args.size() > 6 ? std::stoul(args.at(6)) : 1000;
  Endpoint in = out;
  in.topic = args.at(1);
  in.is_reader = true;
  const std::unique_ptr<Writer> writer = peer.participant.create_writer(out);
  std::size_t count = 0;
  const std::unique_ptr<Reader> reader = peer.participant.create_reader(
      in, [&](std::span<const std::byte> message, const SampleInfo& /*info*/) {
        Buffer answer = buffer_of(message);
        writer->write(answer);
        ++count;
      });
  announce(peer.participant, peer.graph, reader.get(), writer.get());
  print_ready();
  serve(peer.participant);
  fmt::print("{} came, {} lost, {} writers and {} readers found\n", count, reader->lost(),
             reader->matched(), writer->matched());
}

/// A writer that has found a reader, which has had time to find the writer.
std::unique_ptr<Writer> open_writer(const Peer& peer) {
  std::unique_ptr<Writer> writer = peer.participant.create_writer(endpoint_of(peer, 1, false));
  announce(peer.participant, peer.graph, nullptr, writer.get());
  print_ready();
  while (writer->matched() == 0) {
    peer.participant.serve(10ms);
  }
  std::this_thread::sleep_for(500ms);
  return writer;
}

void send(const Peer& peer) {
  const std::string bytes = read_file(peer.args.at(6));
  const std::unique_ptr<Writer> writer = open_writer(peer);
  for (unsigned long count = std::stoul(peer.args.at(5)); count > 0; --count) {
    Buffer message = buffer_of(std::as_bytes(std::span(bytes)));
    try {
      writer->write(message);
    } catch (const EngineError&) {
      // The reader is too slow for a reliable writer; the next one may go.
    }
  }
  serve(peer.participant);
}

void play(const Peer& peer) {
  const std::chrono::milliseconds period(std::stoul(peer.args.at(5)));
  const std::unique_ptr<Writer> writer = open_writer(peer);
  for (std::size_t i = 6; i < peer.args.size(); ++i) {
    const std::string bytes = read_file(peer.args[i]);
    Buffer message = buffer_of(std::as_bytes(std::span(bytes)));
    const auto began = (std::chrono::system_clock::now() - 100ms).time_since_epoch();
    const auto seconds = std::chrono::floor<std::chrono::seconds>(began);
    const std::array<std::uint32_t, 2> stamp = {
        static_cast<std::uint32_t>(seconds.count()),
        static_cast<std::uint32_t>(std::chrono::nanoseconds(began - seconds).count())};
    std::memcpy(message.data() + fastcycle::ros2::kEncapsulationBytes, stamp.data(), sizeof stamp);
    writer->write(message);
    std::this_thread::sleep_for(period);
  }
  serve(peer.participant);
}

void keep(const Peer& peer) {
  std::size_t count = 0;
  const std::unique_ptr<Reader> reader = peer.participant.create_reader(
      endpoint_of(peer, 1, true),
      [&](std::span<const std::byte> message, const SampleInfo& /*info*/) {
        std::ofstream file(fmt::format("{}/{:06}.cdr", peer.args.at(5), ++count), std::ios::binary);
        file.write(reinterpret_cast<const char*>(message.data()),
                   static_cast<std::streamsize>(message.size()));
      });
  announce(peer.participant, peer.graph, reader.get(), nullptr);
  print_ready();
  serve(peer.participant);
}

/// One end of the service that the second word names, of std_srvs/srv/SetBool.
Endpoint service_end(const Peer& peer, const std::string& user_data, bool is_request,
                     bool is_reader) {
  const std::string& service = peer.args.at(1);
  return {.topic = is_request ? fastcycle::ros2::dds_request_topic(service)
                              : fastcycle::ros2::dds_reply_topic(service),
          .type = is_request ? "std_srvs::srv::dds_::SetBool_Request_"
                             : "std_srvs::srv::dds_::SetBool_Response_",
          .user_data = user_data,
          .qos = {},
          .is_reader = is_reader,
          .role = is_request ? Role::kRequests : Role::kReplies};
}

void serve_bool(const Peer& peer) {
  const std::string id = peer.participant.service_user_data(false);
  const std::unique_ptr<Writer> writer =
      peer.participant.create_writer(service_end(peer, id, false, false));
  const std::unique_ptr<Reader> reader = peer.participant.create_reader(
      service_end(peer, id, true, true),
      [&](std::span<const std::byte> message, const SampleInfo& info) {
        CdrReader in(message);
        const bool is_set = in.boolean("data");
        Buffer reply;
        CdrWriter out(reply);
        out.boolean(is_set);
        out.text(is_set ? "set there" : "not set there");
        out.end();
        writer->write_reply(reply, info.request);
      });
  announce(peer.participant, peer.graph, reader.get(), writer.get());
  print_ready();
  serve(peer.participant);
}

void ask_bool(const Peer& peer) {
  const std::string id = peer.participant.service_user_data(true);
  const std::unique_ptr<Writer> writer =
      peer.participant.create_writer(service_end(peer, id, true, false));
  fastcycle::dds_gateway::Identity asked;
  bool is_set = false;
  bool is_answered = true;
  unsigned long right = 0;
  const std::unique_ptr<Reader> reader = peer.participant.create_reader(
      service_end(peer, id, false, true),
      [&](std::span<const std::byte> message, const SampleInfo& info) {
        CdrReader in(message);
        if (info.request == asked && !is_answered) {
          right += in.boolean("success") == is_set ? 1 : 0;
          is_answered = true;
        }
      });
  announce(peer.participant, peer.graph, reader.get(), writer.get());
  print_ready();
  while (writer->matched() == 0 || reader->matched() == 0) {
    peer.participant.serve(10ms);
  }
  const unsigned long count = std::stoul(peer.args.at(2));
  auto sent = std::chrono::steady_clock::now();
  while (right < count) {
    // The first reply may go before the server has found its reader.
    if (is_answered || std::chrono::steady_clock::now() - sent > 1s) {
      is_set = is_answered ? !is_set : is_set;
      is_answered = false;
      Buffer request;
      CdrWriter out(request);
      out.boolean(is_set);
      out.end();
      asked = writer->write_request(request, reader->guid());
      sent = std::chrono::steady_clock::now();
    }
    peer.participant.serve(10ms);
  }
  fmt::print("{} answers were right\n", right);
  std::fflush(stdout);
  serve(peer.participant);
}

int run(std::vector<std::string> args) {
  std::string security;
  if (args.at(3) == "secured") {
    security = args.at(4);
    args.erase(args.begin() + 3, args.begin() + 5);
  }
  const Engine* engine = nullptr;
  for (const Engine& one : engines()) {
    engine = args.at(0) == one.name ? &one : engine;
  }
  if (engine == nullptr) {
    throw std::runtime_error("there is no engine " + args.at(0));
  }
  const ParticipantOptions options{.domain = static_cast<std::uint32_t>(std::stoul(args.at(1))),
                                   .interface = args.at(2),
                                   .user_data = "enclave=/;",
                                   .security = security};
  args.erase(args.begin(), args.begin() + 3);
  const std::string mode = args.at(0);
  if (mode == "come_and_go") {
    print_ready();
    for (unsigned long count = std::stoul(args.at(3)); count > 0; --count) {
      const auto participant = engine->create(options);
      const std::unique_ptr<Writer> writer = participant->create_writer(
          {.topic = args.at(1), .type = args.at(2), .user_data = "", .qos = {}});
      const std::unique_ptr<Writer> graph = participant->create_writer(graph_endpoint(false));
      announce(*participant, *graph, nullptr, writer.get());
      participant->serve(20ms);
    }
    return 0;
  }
  const auto participant = engine->create(options);
  const std::unique_ptr<Writer> graph = participant->create_writer(graph_endpoint(false));
  const Peer peer{.participant = *participant, .graph = *graph, .args = std::move(args)};
  struct Mode {
    const char* name;
    void (*run)(const Peer&);
  };
  constexpr Mode kModes[] = {{"echo", echo}, {"send", send},        {"play", play},
                             {"keep", keep}, {"serve", serve_bool}, {"ask", ask_bool}};
  for (const Mode& one : kModes) {
    if (mode == one.name) {
      one.run(peer);
      return 0;
    }
  }
  throw std::runtime_error("there is no mode " + mode);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dds_gateway_peer: %s\n", error.what());
    return 1;
  }
}
