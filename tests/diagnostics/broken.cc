// A component with one of the errors that beginners make; "how" says which, "where" in which
// call.

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <dlfcn.h>
#include <fastcycle/fastcycle.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include "blame/count.pb.h"

namespace broken {

using namespace std::chrono_literals;

int zero() {
  static volatile int none = 0;
  return none;
}

/// An address that the compiler knows nothing of.
template <typename T>
T* address(std::uintptr_t number) {
  static volatile std::uintptr_t offset = 0;
  return reinterpret_cast<T*>(number + offset);
}

[[gnu::noinline]] void write_to_null() {
  *address<volatile int>(0) = 1;
}

[[gnu::noinline]] void call_null() {
  address<void()>(0)();
}

[[gnu::noinline]] void write_to_constant() {
  // Its own code may be read, and no more.
  *address<volatile char>(reinterpret_cast<std::uintptr_t>(&write_to_null)) = 1;
}

// NOLINTNEXTLINE(misc-no-recursion): that is the fault.
[[gnu::noinline]] int recurse(int depth) {
  volatile char some[1024];
  some[static_cast<std::size_t>(depth) % sizeof(some)] = static_cast<char>(depth);
  return depth < 0 ? 0 : recurse(depth + 1) + some[0];
}

[[gnu::noinline]] void take_a_large_array() {
  volatile char image[40UL * 1024 * 1024];
  for (std::size_t i = 0; i < sizeof(image); i += 512) {
    image[i] = 1;
  }
}

[[gnu::noinline]] void spin() {
  for (volatile bool goes_on = true; goes_on;) {
  }
}

[[gnu::noinline]] void lock_twice() {
  static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  pthread_mutex_lock(&mutex);
  pthread_mutex_lock(&mutex);
}

[[gnu::noinline]] int divide_by(int number) {
  return 100 / number;
}

[[gnu::noinline]] void throw_promise() {
  throw std::logic_error("this function promised not to throw\x1b[31m");
}

[[gnu::noinline]] void promise_in_vain() noexcept {
  throw_promise();
}

[[gnu::noinline]] void use_after_free() {
  auto numbers = std::make_unique<std::vector<int>>(1000, 7);
  std::vector<int>* volatile gone = numbers.get();
  numbers.reset();
  auto* const bytes = reinterpret_cast<volatile char*>(gone);
  for (std::size_t i = 0; i < sizeof(*gone); ++i) {
    bytes[i] = '\x5a';  // As the next owner may.
  }
  (*gone)[3] = 1;
}

[[gnu::noinline]] void free_twice() {
  int* volatile number = new int(1);
  int* const copy = number;
  delete copy;
  delete number;
}

[[gnu::noinline]] void take_all_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = 4UL * 1024 * 1024 * 1024;
  setrlimit(RLIMIT_AS, &limit);
  static std::vector<std::unique_ptr<char[]>> kept;
  for (;;) {
    kept.emplace_back(new char[256UL * 1024 * 1024]);
  }
}

/// As a build does that ends meanwhile.
[[gnu::noinline]] void write_own_library() {
  Dl_info info{};
  dladdr(reinterpret_cast<const void*>(&write_own_library), &info);
  std::ofstream(info.dli_fname, std::ios::app) << "more";
}

/// Children that are made by all calls of this, at most.
constexpr int kChildrenMax = 3;

[[gnu::noinline]] void fork_and_return() {
  static int children = 0;
  if (children < kChildrenMax) {
    ++children;
    fork();
  }
}

[[gnu::noinline]] void fork_and_exit() {
  static int children = 0;
  if (children < kChildrenMax && ++children > 0 && fork() == 0) {
    std::exit(0);
  }
}

volatile int result_of_division = 0;

void cause_fault(const std::string& how) {
  if (how == "segfault") {
    write_to_null();
  } else if (how == "call of null") {
    call_null();
  } else if (how == "constant") {
    write_to_constant();
  } else if (how == "stack") {
    recurse(zero());
  } else if (how == "large array") {
    take_a_large_array();
  } else if (how == "abort") {
    std::abort();
  } else if (how == "division") {
    result_of_division = divide_by(zero());
  } else if (how == "bus error") {
    raise(SIGBUS);
  } else if (how == "trap") {
    __builtin_trap();
  } else if (how == "exit") {
    std::exit(zero());
  } else if (how == "_exit") {
    _exit(zero());
  } else if (how == "quick_exit") {
    std::quick_exit(zero());
  } else if (how == "terminate") {
    promise_in_vain();
  } else if (how == "throw") {
    throw std::runtime_error("no calibration");
  } else if (how == "throw of int") {
    throw 42;
  } else if (how == "loop") {
    spin();
  } else if (how == "deadlock") {
    lock_twice();
  } else if (how == "sleep") {
    std::this_thread::sleep_for(1000s);
  } else if (how == "use after free") {
    use_after_free();
  } else if (how == "free twice") {
    free_twice();
  } else if (how == "memory") {
    take_all_memory();
  } else if (how == "joins") {
    std::thread([] { spin(); }).join();
  } else if (how == "write own library") {
    write_own_library();
  } else if (how == "fork") {
    fork_and_return();
  } else if (how == "fork and exit") {
    fork_and_exit();
  } else if (how == "own thread") {
    std::thread([] { write_to_null(); }).join();
  } else if (how == "throw in own thread") {
    std::thread([] { throw std::runtime_error("in a thread of mine"); }).join();
  }
}

class Broken final : public fastcycle::Component {
 public:
  explicit Broken(fastcycle::Context& context)
      : Component(context),
        how_(context.param<std::string>("how")),
        where_(context.param<std::string>("where", {.fallback = "callback"})) {
    if (is_in_program()) {  // The trial makes the object first, in a process of its own.
      break_in("constructor");
    } else {
      break_in("trial");
    }
    context.create_subscriber<blame::Count>("counts", [this](const blame::Count& count) {
      if (count.value() >= 20) {
        break_in("callback");
      }
    });
    if (where_.get() == "work") {
      context.create_subscriber<blame::Count>("counts", [this](const blame::Count& count) {
        if (count.value() >= 20 && !std::exchange(has_offloaded_, true)) {
          this->context().offload("side", [this] { break_in("work"); }, [] {});
        }
      });
    }
    if (where_.get() == "behind work") {
      context.create_subscriber<blame::Count>("counts", [this](const blame::Count& count) {
        if (count.value() >= 20 && !std::exchange(has_offloaded_, true)) {
          this->context().offload("side", [] {}, [this] { break_in("behind work"); });
        }
      });
    }
    if (where_.get() == "thread") {
      context.create_thread("reader", [this](const std::stop_token&) { break_in("thread"); });
    }
  }
  ~Broken() override {
    if (is_in_program()) {
      break_in("destructor");
    }
  }

  void start() override { break_in("start"); }
  void serve() override { break_in("serve"); }
  void stop() override { break_in("stop"); }

 private:
  void break_in(const char* where) const {
    if (where_.get() == where && how_.get() == "many lines") {
      for (int i = 1; i <= 1000; ++i) {
        log().info("line {}", i);
      }
      write_to_null();
    } else if (where_.get() == where) {
      cause_fault(how_.get());
    }
  }

  /// Not in the trial, which finds what ends a constructor before anything runs.
  static bool is_in_program() { return std::string(program_invocation_short_name) == "fastcycle"; }

  fastcycle::Param<std::string> how_;
  fastcycle::Param<std::string> where_;
  bool has_offloaded_ = false;
};

}  // namespace broken

using broken::Broken;
FASTCYCLE_COMPONENT(Broken)
