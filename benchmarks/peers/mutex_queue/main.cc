// A typical implementation without middleware: malloc, a queue with a mutex and a condition
// variable, and one thread that takes from it.

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <memory>
#include <mutex>
#include <new>
#include <thread>
#include <utility>

#include <sys/mman.h>

#include "peers/common/peer.h"
#include "peers/common/plain_message.h"
#include "peers/common/thread.h"

namespace fastcycle::peers {
namespace {

/// The source of payloads: malloc, which soon reuses the same few, or new pages from the kernel
/// each time, so that the publisher pays for a fault a page.
enum class Memory : std::uint8_t { kMalloc, kFreshPages };

struct Free {
  Memory memory = Memory::kMalloc;
  std::size_t bytes = 0;

  void operator()(PlainMessage* message) const noexcept {
    if (memory == Memory::kMalloc) {
      std::free(message);
    } else {
      munmap(message, bytes);
    }
  }
};
using Owned = std::unique_ptr<PlainMessage, Free>;

void* fresh_pages(std::size_t bytes) {
  void* pages = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  return pages == MAP_FAILED ? nullptr : pages;
}

Owned allocate(Memory memory, std::size_t size) {
  const std::size_t bytes = PlainMessage::bytes(size);
  void* place = memory == Memory::kMalloc ? std::malloc(bytes) : fresh_pages(bytes);
  if (place == nullptr) {
    throw std::bad_alloc();
  }
  return Owned(new (place) PlainMessage, Free{.memory = memory, .bytes = bytes});
}

class Queue {
 public:
  void put(Owned message) {
    {
      const std::lock_guard lock(mutex_);
      messages_.push_back(std::move(message));
    }
    is_changed_.notify_one();  // Without the mutex, so that the woken thread need not wait for it.
  }

  /// Waits for the next one; null if the queue was closed.
  [[nodiscard]] Owned take() {
    std::unique_lock lock(mutex_);
    is_changed_.wait(lock, [this] { return is_closed_ || !messages_.empty(); });
    if (messages_.empty()) {
      return {};
    }
    Owned message = std::move(messages_.front());
    messages_.pop_front();
    return message;
  }

  void close() {
    {
      const std::lock_guard lock(mutex_);
      is_closed_ = true;
    }
    is_changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable is_changed_;
  std::deque<Owned> messages_;
  bool is_closed_ = false;
};

/// Ends the receivers even if the publisher throws.
struct Closing {
  Queue& queue;

  ~Closing() { queue.close(); }
};

void measure_queue(Run& run, Memory memory) {
  Queue there;
  Queue back;
  Queue& last = run.is_rtt() ? back : there;
  std::jthread echo;
  if (run.is_rtt()) {
    echo = start_thread([&] {
      while (Owned message = there.take()) {
        back.put(std::move(message));
      }
    });
  }
  const std::jthread receiver = start_thread([&] {
    while (const Owned message = last.take()) {
      const std::int64_t arrived_ns = now_ns();
      run.arrived(message->stamps, message->data(), arrived_ns);
    }
  });
  const Closing closing_there{there};
  const Closing closing_back{back};
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    Owned message = allocate(memory, run.size());
    measure::fill(message->data(), run.size(), number);
    message->stamps = {.number = number, .made_ns = made_ns, .sent_ns = now_ns()};
    there.put(std::move(message));
  });
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "mutex_queue",
       .version = "1",
       .variants = {
           {.name = "malloc",
            .about = "A mutex, a condition variable, a queue of pointers, malloc for each message.",
            .delivery = Delivery::kBetweenThreads,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) { measure_queue(run, Memory::kMalloc); }},
           {.name = "fresh-pages",
            .about = "The same, with mmap for each message instead of malloc.",
            .delivery = Delivery::kBetweenThreads,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) { measure_queue(run, Memory::kFreshPages); },
            .busy_us_per_mib = 600}}});
}
