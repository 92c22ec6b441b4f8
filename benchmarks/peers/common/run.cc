#include "peers/common/run.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>

#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::peers {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;
constexpr std::int64_t kGiveUpAfter = 1000 * kMillisecond;
constexpr std::int64_t kSecondProcessTimeout = 15'000 * kMillisecond;

}  // namespace

Run::Run(Mode mode, const measure::Plan& plan) : mode_(mode), plan_(plan) {
  // Shared, with all pages touched, so that recording a stamp never faults.
  void* memory = mmap(nullptr, mapped_bytes(), PROT_READ | PROT_WRITE,
                      MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (memory == MAP_FAILED) {
    throw std::runtime_error(std::string("no memory for the stamps: ") + std::strerror(errno));
  }
  board_ = new (memory) Board;
  samples_ = new (static_cast<char*>(memory) + sizeof(Board)) measure::Sample[1];
}

Run::~Run() {
  if (second_ > 0) {
    kill(second_, SIGKILL);
    waitpid(second_, nullptr, 0);
  }
  munmap(board_, mapped_bytes());
}

std::size_t Run::mapped_bytes() const noexcept {
  const std::int64_t samples = is_flood() ? 1 : total();
  return sizeof(Board) + static_cast<std::size_t>(samples) * sizeof(measure::Sample);
}

void Run::arrived(const Stamps& stamps, const void* data, std::int64_t arrived_ns) noexcept {
  if (is_second_ && stamps.number >= plan_.warmup && !is_second_measuring_.exchange(true)) {
    usage_at_begin_ = measure::Usage::now();
  }
  const std::int64_t index = board_->received.fetch_add(1, std::memory_order_acq_rel);
  if (!is_flood() && index < total()) {
    samples_[index] = {stamps.number, stamps.made_ns, stamps.sent_ns, arrived_ns};
  }
  if (stamps.number >= plan_.warmup) {
    board_->received_measured.fetch_add(1, std::memory_order_relaxed);
    board_->last_arrived_ns.store(arrived_ns, std::memory_order_relaxed);
  }
  if (!measure::is_filled(data, size(), stamps.number)) {
    board_->damaged.fetch_add(1, std::memory_order_relaxed);
  }
}

void Run::begin_measuring() noexcept {
  usage_at_begin_ = measure::Usage::now();
  began_ns_ = now_ns();
}

void Run::wait_for_window(std::int64_t number) noexcept {
  const auto on_their_way = [&] {
    return number - board_->received.load(std::memory_order_acquire) - given_up_;
  };
  std::int64_t stuck_at = 0;
  std::int64_t stuck_since_ns = 0;
  while (on_their_way() >= kWindow) {
    sched_yield();
    const std::int64_t received = board_->received.load(std::memory_order_acquire);
    if (stuck_since_ns == 0 || received != stuck_at) {
      stuck_at = received;
      stuck_since_ns = now_ns();
    } else if (now_ns() - stuck_since_ns > kGiveUpAfter / 10) {
      given_up_ += on_their_way();  // Lost: waiting for them would never end.
    }
  }
}

void Run::wait_for_rest() noexcept {
  std::int64_t received = -1;
  std::int64_t since_ns = now_ns();
  while (board_->received.load(std::memory_order_acquire) < total() &&
         now_ns() - since_ns < kGiveUpAfter) {
    if (const std::int64_t now = board_->received.load(std::memory_order_acquire);
        now != received) {
      received = now;
      since_ns = now_ns();
    }
    measure::sleep_until(now_ns() + kMillisecond);
  }
  usage_ = measure::Usage::now() - usage_at_begin_;
  board_->is_over.store(true, std::memory_order_release);
}

void Run::in_second_process(const std::function<void()>& receive) {
  std::fflush(nullptr);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) {
    throw std::runtime_error(std::string("fork: ") + std::strerror(errno));
  }
  if (child > 0) {
    second_ = child;
    return;
  }
  is_second_ = true;
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // It must not outlive the first process.
  int status = getppid() == parent ? EXIT_SUCCESS : EXIT_FAILURE;
  try {
    if (status == EXIT_SUCCESS) {
      receive();
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "second process: %s\n", error.what());
    status = EXIT_FAILURE;
  }
  board_->second_usage = measure::Usage::now() - usage_at_begin_;
  std::exit(status);  // Runs the destructors of the peer's own globals.
}

void Run::wait_for_second_ready() const {
  const std::int64_t deadline_ns = now_ns() + kSecondProcessTimeout;
  while (!board_->is_second_ready.load(std::memory_order_acquire)) {
    if (now_ns() > deadline_ns || waitpid(second_, nullptr, WNOHANG) != 0) {
      throw std::runtime_error("the second process did not get ready");
    }
    measure::sleep_until(now_ns() + kMillisecond);
  }
}

void Run::join_second_process() {
  const std::int64_t deadline_ns = now_ns() + kSecondProcessTimeout;
  int status = 0;
  while (waitpid(second_, &status, WNOHANG) == 0) {
    if (now_ns() > deadline_ns) {
      throw std::runtime_error("the second process did not end");
    }
    measure::sleep_until(now_ns() + kMillisecond);
  }
  second_ = 0;
  if (status != 0) {
    throw std::runtime_error("the second process failed");
  }
  usage_ += board_->second_usage;
}

measure::Row Run::finish() {
  if (second_ > 0) {
    join_second_process();
  }
  measure::Row row{.peer = {},
                   .mode = is_rtt()     ? "rtt"
                           : is_flood() ? "flood"
                                        : "latency",
                   .size = plan_.size,
                   .warmup = plan_.warmup,
                   .interval_us = is_flood() ? 0 : plan_.interval_us};
  const std::int64_t received = board_->received_measured.load();
  if (received == 0) {
    throw std::runtime_error("nothing arrived");
  }
  if (const std::int64_t damaged = board_->damaged.load(); damaged > 0) {
    throw std::runtime_error(std::to_string(damaged) + " payloads are not what was sent");
  }
  if (is_flood()) {
    row.n = row.received.emplace(received);
    row.lost = row.sent.emplace(plan_.count) - received;
    row.rate_per_s = static_cast<double>(received) * 1e9 /
                     static_cast<double>(board_->last_arrived_ns.load() - began_ns_);
    row.usage = usage_;
    row.cpu_us_per_msg = usage_.cpu_us / static_cast<double>(plan_.count);
    return row;
  }
  measure::Samples samples(samples_, samples_ + std::min(board_->received.load(), total()));
  // If several threads run callbacks, messages end in another order than sent.
  std::sort(samples.begin(), samples.end(),
            [](const auto& a, const auto& b) { return a.number < b.number; });
  measure_into(row, samples, plan_.count, usage_);
  return row;
}

}  // namespace fastcycle::peers
