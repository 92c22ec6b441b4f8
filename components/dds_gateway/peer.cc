// Another process in the network of a test, with an engine of its own and nothing of FastCycle's:
// it sends back what it gets, or counts it.
//
//     dds_gateway_peer ENGINE DOMAIN INTERFACE [secured ENCLAVE] echo IN OUT TYPE RELIABILITY
//     DURABILITY [DEPTH] dds_gateway_peer ENGINE DOMAIN INTERFACE [secured ENCLAVE] send OUT TYPE
//     RELIABILITY DURABILITY COUNT FILE
//
// IN, OUT and TYPE are names of DDS. `echo` answers until its standard input ends, and then says on
// its standard output what came, and how many readers and writers it has found. `send` waits
// until a reader was found, sends the bytes of FILE COUNT times, and then waits for the end of its
// standard input.
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
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "dds_gateway/engine.h"
#include "dds_gateway/ros_graph.h"

namespace {

using namespace std::chrono_literals;
using namespace fastcycle::dds_gateway;
using fastcycle::ros2::Buffer;

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
  const auto participant =
      engine->create({.domain = static_cast<std::uint32_t>(std::stoul(args.at(1))),
                      .interface = args.at(2),
                      .user_data = "enclave=/;",
                      .security = security});
  const std::unique_ptr<Writer> graph = participant->create_writer(graph_endpoint(false));
  if (args.at(3) == "echo") {
    const std::size_t depth = args.size() > 9 ? std::stoul(args.at(9)) : 1000;
    Endpoint out{.topic = args.at(5),
                 .type = args.at(6),
                 .user_data = "",
                 .qos = qos_of(args.at(7), args.at(8), depth)};
    Endpoint in = out;
    in.topic = args.at(4);
    in.is_reader = true;
    const std::unique_ptr<Writer> writer = participant->create_writer(out);
    std::size_t count = 0;
    const std::unique_ptr<Reader> reader = participant->create_reader(
        in, [&](std::span<const std::byte> message, const SampleInfo& /*info*/) {
          Buffer answer = buffer_of(message);
          writer->write(answer);
          ++count;
        });
    announce(*participant, *graph, reader.get(), writer.get());
    fmt::print("ready\n");
    std::fflush(stdout);
    serve(*participant);
    fmt::print("{} came, {} lost, {} writers and {} readers found\n", count, reader->lost(),
               reader->matched(), writer->matched());
    return 0;
  }
  const Endpoint out{.topic = args.at(4),
                     .type = args.at(5),
                     .user_data = "",
                     .qos = qos_of(args.at(6), args.at(7), 1000)};
  std::ifstream file(args.at(9), std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  const std::unique_ptr<Writer> writer = participant->create_writer(out);
  announce(*participant, *graph, nullptr, writer.get());
  fmt::print("ready\n");
  std::fflush(stdout);
  while (writer->matched() == 0) {
    participant->serve(10ms);
  }
  for (unsigned long count = std::stoul(args.at(8)); count > 0; --count) {
    Buffer message = buffer_of(std::as_bytes(std::span(bytes)));
    writer->write(message);
  }
  serve(*participant);
  return 0;
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
