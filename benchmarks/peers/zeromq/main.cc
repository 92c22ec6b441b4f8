// ZeroMQ between the threads of one process. https://libzmq.readthedocs.io

#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>

#include <zmq.h>

#include "peers/common/peer.h"
#include "peers/common/plain_message.h"
#include "peers/common/thread.h"

namespace fastcycle::peers {
namespace {

void check(int result, const char* what) {
  if (result == -1) {
    throw std::runtime_error(std::string(what) + ": " + zmq_strerror(zmq_errno()));
  }
}

struct Terminate {
  void operator()(void* context) const noexcept { zmq_ctx_term(context); }
};
struct Close {
  void operator()(void* socket) const noexcept { zmq_close(socket); }
};
using Context = std::unique_ptr<void, Terminate>;
using Socket = std::unique_ptr<void, Close>;

/// One end of a PAIR: "the exclusive pair pattern is used to connect a peer to precisely one other
/// peer. This pattern is used for inter-thread communication across the inproc transport"
/// (zmq_socket). Receiving ends after 100 ms without a message, to see whether the run is over.
Socket make_socket(void* context) {
  Socket socket(zmq_socket(context, ZMQ_PAIR));
  if (!socket) {
    throw std::runtime_error(std::string("zmq_socket: ") + zmq_strerror(zmq_errno()));
  }
  const int timeout_ms = 100;
  check(zmq_setsockopt(socket.get(), ZMQ_RCVTIMEO, &timeout_ms, sizeof(timeout_ms)),
        "ZMQ_RCVTIMEO");
  const int linger_ms = 0;
  check(zmq_setsockopt(socket.get(), ZMQ_LINGER, &linger_ms, sizeof(linger_ms)), "ZMQ_LINGER");
  return socket;
}

struct Pair {
  Pair(void* context, const std::string& address)
      : sender(make_socket(context)), receiver(make_socket(context)) {
    check(zmq_bind(receiver.get(), address.c_str()), "zmq_bind");
    check(zmq_connect(sender.get(), address.c_str()), "zmq_connect");
  }
  Socket sender;
  Socket receiver;
};

/// Calls `take(message)` for each message until the run has ended.
template <typename Take>
void receive_all(const Run& run, void* socket, const Take& take) {
  zmq_msg_t message;
  zmq_msg_init(&message);
  while (!run.is_over()) {
    if (zmq_msg_recv(&message, socket, 0) != -1) {
      take(message);
    }
  }
  zmq_msg_close(&message);
}

void free_message(void* data, void* /*hint*/) {
  std::free(data);
}

void send(void* socket, PlainMessage* message, std::size_t bytes) {
  zmq_msg_t envelope;
  // "No copy of data shall be performed and 0MQ shall take ownership of the supplied buffer"
  // (zmq_msg_init_data). Over inproc the receiver gets the same buffer.
  check(zmq_msg_init_data(&envelope, message, bytes, free_message, nullptr), "zmq_msg_init_data");
  check(zmq_msg_send(&envelope, socket, 0), "zmq_msg_send");
}

void measure_inproc(Run& run) {
  const Context context(zmq_ctx_new());
  // "If your application is using only the inproc transport for messaging you may set this to zero"
  // (ZMQ_IO_THREADS in zmq_ctx_set).
  check(zmq_ctx_set(context.get(), ZMQ_IO_THREADS, 0), "ZMQ_IO_THREADS");
  const Pair there(context.get(), "inproc://payload");
  const Pair back(context.get(), "inproc://echo");
  run.holds_back_by_itself();  // The high water marks: 1000 messages on each side.
  std::jthread echo;
  if (run.is_rtt()) {
    // Passing a socket to another thread needs a full fence, which starting a thread is.
    echo = start_thread([&] {
      receive_all(run, there.receiver.get(),
                  [&](zmq_msg_t& message) { zmq_msg_send(&message, back.sender.get(), 0); });
    });
  }
  const std::jthread receiver = start_thread([&] {
    receive_all(run, (run.is_rtt() ? back : there).receiver.get(), [&](zmq_msg_t& envelope) {
      const std::int64_t arrived_ns = now_ns();
      const auto* message = static_cast<const PlainMessage*>(zmq_msg_data(&envelope));
      run.arrived(message->stamps, message->data(), arrived_ns);
    });
  });
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    auto* message = new (std::malloc(PlainMessage::bytes(run.size()))) PlainMessage;
    measure::fill(message->data(), run.size(), number);
    message->stamps = {.number = number, .made_ns = made_ns, .sent_ns = now_ns()};
    send(there.sender.get(), message, PlainMessage::bytes(run.size()));
  });
}

std::string version() {
  int major = 0;
  int minor = 0;
  int patch = 0;
  zmq_version(&major, &minor, &patch);
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(patch);
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "zeromq",
       .version = version(),
       .variants = {{.name = "inproc",
                     .about = "A PAIR of sockets over inproc; a pointer is handed over.",
                     .delivery = Delivery::kBetweenThreads,
                     .is_typed = false,
                     .copies = "none",
                     .measure = measure_inproc}}});
}
