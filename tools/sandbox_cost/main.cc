// Measures the cost of the sandbox: each kind of call in a process with it and without it, in
// turns.
//
//     sandbox_cost [rounds]

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "sandbox/sandbox.h"

namespace fastcycle {
namespace {

constexpr int kDefaultRounds = 15;
constexpr int kMaxRounds = 1000;

/// The measurements of one process, in nanoseconds.
struct Costs {
  double apply = 0;      ///< To apply the sandbox.
  double futex = 0;      ///< A wake-up without a waiter.
  double file = 0;       ///< lseek of an open file.
  double mapping = 0;    ///< mmap and munmap of a page: the filter looks at an argument.
  double hand_over = 0;  ///< A round trip between two threads that sleep by futex, halved.
  double refused = 0;    ///< A refused call.
};

template <typename Act>
double time_of(int count, const Act& act) {
  const std::int64_t begin_ns = base::monotonic_ns();
  for (int i = 0; i < count; ++i) {
    act();
  }
  return static_cast<double>(base::monotonic_ns() - begin_ns) / count;
}

using Word = std::atomic<std::uint32_t>;

long futex(Word& word, int operation, std::uint32_t value) {
  return syscall(SYS_futex, &word, operation, value, nullptr, nullptr, 0);
}

double time_hand_over() {
  constexpr std::uint32_t kTrips = 4000;
  Word there{0};
  Word back{0};
  const auto wait_for = [](Word& word, std::uint32_t value) {
    for (std::uint32_t seen; (seen = word.load()) != value;) {
      futex(word, FUTEX_WAIT_PRIVATE, seen);
    }
  };
  const auto set = [](Word& word, std::uint32_t value) {
    word.store(value);
    futex(word, FUTEX_WAKE_PRIVATE, 1);
  };
  std::thread other([&] {
    for (std::uint32_t i = 1; i <= kTrips; ++i) {
      wait_for(there, i);
      set(back, i);
    }
  });
  const std::int64_t begin_ns = base::monotonic_ns();
  for (std::uint32_t i = 1; i <= kTrips; ++i) {
    set(there, i);
    wait_for(back, i);
  }
  const auto total_ns = static_cast<double>(base::monotonic_ns() - begin_ns);
  other.join();
  return total_ns / kTrips / 2;
}

Costs measure() {
  Costs costs;
  Word nobody{0};
  constexpr int kCalls = 100'000;
  costs.futex = time_of(kCalls, [&] { futex(nobody, FUTEX_WAKE_PRIVATE, 1); });
  costs.file = time_of(kCalls, [] { syscall(SYS_lseek, 0, 0, SEEK_CUR); });
  costs.mapping = time_of(kCalls / 10, [] {
    munmap(mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0), 4096);
  });
  costs.hand_over = time_hand_over();
  costs.refused = time_of(kCalls / 10, [] {
    // Outside of a sandbox: a call that fails at once.
    static_cast<void>(socket(-1, 0, 0));
  });
  return costs;
}

/// Measures in a child process, which the sandbox ends with.
Costs measure_in_child(bool is_sandboxed) {
  int ends[2];
  if (pipe(ends) != 0) {
    std::perror("pipe");
    std::exit(1);
  }
  const pid_t child = fork();
  if (child == 0) {
    double apply_ns = 0;
    if (is_sandboxed) {
      const std::int64_t begin_ns = base::monotonic_ns();
      if (const auto refusal = sandbox::apply_sandbox({})) {
        std::fprintf(stderr, "%s (%s)\n", refusal->what.c_str(), refusal->remedy.c_str());
        _exit(1);
      }
      apply_ns = static_cast<double>(base::monotonic_ns() - begin_ns);
    }
    Costs costs = measure();
    costs.apply = apply_ns;
    _exit(write(ends[1], &costs, sizeof(costs)) == sizeof(costs) ? 0 : 1);
  }
  close(ends[1]);
  Costs costs;
  const bool is_read = child > 0 && read(ends[0], &costs, sizeof(costs)) == sizeof(costs);
  close(ends[0]);
  if (child > 0) {
    waitpid(child, nullptr, 0);
  }
  if (!is_read) {
    std::fputs("sandbox_cost: a process measured nothing\n", stderr);
    std::exit(1);
  }
  return costs;
}

double median(const std::vector<Costs>& all, double Costs::* cost) {
  std::vector<double> values;
  for (const Costs& costs : all) {
    values.push_back(costs.*cost);
  }
  std::ranges::sort(values);
  return values[values.size() / 2];
}

int run(int rounds) {
  std::vector<Costs> plain;
  std::vector<Costs> sandboxed;
  for (int round = 0; round < rounds; ++round) {
    // Each is first as often as the other.
    const bool is_first = round % 2 == 0;
    (is_first ? plain : sandboxed).push_back(measure_in_child(!is_first));
    (is_first ? sandboxed : plain).push_back(measure_in_child(is_first));
  }
  struct Line {
    const char* name;
    double Costs::* cost;
  };
  constexpr std::array kLines{Line{"futex, a wake-up of nobody", &Costs::futex},
                              Line{"lseek of an open file", &Costs::file},
                              Line{"mmap and munmap of a page", &Costs::mapping},
                              Line{"hand-over between two threads that sleep", &Costs::hand_over},
                              Line{"socket, which the sandbox refuses", &Costs::refused}};
  std::printf("%-42s %12s %12s %10s\n", "medians of processes, ns", "without", "sandboxed", "more");
  for (const Line& line : kLines) {
    const double without = median(plain, line.cost);
    const double with = median(sandboxed, line.cost);
    std::printf("%-42s %12.0f %12.0f %+10.0f\n", line.name, without, with, with - without);
  }
  std::printf("%-42s %12s %12.0f\n", "to apply the sandbox", "", median(sandboxed, &Costs::apply));
  return 0;
}

}  // namespace
}  // namespace fastcycle

int main(int count, char** arguments) {
  const int rounds = count > 1 ? std::atoi(arguments[1]) : fastcycle::kDefaultRounds;
  if (rounds < 1 || rounds > fastcycle::kMaxRounds) {
    std::fputs("usage: sandbox_cost [rounds, 1 to 1000]\n", stderr);
    return 2;
  }
  return fastcycle::run(rounds);
}
