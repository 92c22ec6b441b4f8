#include "base/log.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include <unistd.h>

#include "base/log_level.h"
#include "base/printable.h"

namespace fastcycle::detail {
namespace {

constexpr std::int64_t kReportNs = 1'000'000'000;

/// The escape sequences before and after a level on a terminal.
const char* colour_of(LogLevel level) noexcept {
  switch (level) {
    case LogLevel::kError:
      return "\x1b[31m";
    case LogLevel::kWarning:
      return "\x1b[33m";
    case LogLevel::kDebug:
      return "\x1b[2m";
    case LogLevel::kInfo:
      break;
  }
  return "";
}

bool is_empty(const char* variable) {
  return variable == nullptr || *variable == '\0';
}

std::string head_of(const LogLine& line, Time start) {
  const Duration since = line.time > start ? line.time - start : Duration(0);
  return fmt::format("{}.{:06} ", since.count() / 1'000'000'000,
                     since.count() % 1'000'000'000 / 1000);
}

std::string rest_of(const LogLine& line) {
  // Usually a trailing line end.
  std::string_view text = line.text;
  while (text.ends_with('\n')) {
    text.remove_suffix(1);
  }
  return fmt::format(" {}: {}", base::printable(line.component), base::printable(text));
}

}  // namespace

std::string to_string(const LogLine& line, Time start) {
  return head_of(line, start) + to_word(line.level) + rest_of(line);
}

// The queue is the bounded one of Dmitry Vyukov: a slot's `turn` determines which thread may use
// it. https://www.1024cores.net/home/lock-free-algorithms/queues/bounded-mpmc-queue
LogQueue::LogQueue(const base::Clock& clock)
    : clock_(clock),
      is_terminal_(isatty(STDERR_FILENO) != 0),
      is_coloured_(is_terminal_ && is_empty(std::getenv("NO_COLOR"))),
      slots_(kCapacity) {
  for (std::size_t i = 0; i < kCapacity; ++i) {
    slots_[i].turn.store(i, std::memory_order_relaxed);
  }
  std::vector<base::Refusal> refusals;
  thread_ =
      base::Thread({.name = "fc-log", .cpus = {}}, [this] { print_until_stopped(); }, refusals);
}

LogQueue::~LogQueue() {
  is_stopping_.store(true);
  sleepers_.wake_one();
  thread_.join();
}

void LogQueue::write(const LogLine& line) noexcept {
  std::size_t position = tail_.load(std::memory_order_relaxed);
  for (;;) {
    Slot& slot = slots_[position % kCapacity];
    const std::size_t turn = slot.turn.load(std::memory_order_acquire);
    if (turn == position) {
      if (tail_.compare_exchange_weak(position, position + 1, std::memory_order_relaxed)) {
        slot.time = line.time;
        slot.level = line.level;
        slot.component_size = std::min(line.component.size(), slot.component.size());
        std::copy_n(line.component.begin(), slot.component_size, slot.component.begin());
        slot.text_size = std::min(line.text.size(), slot.text.size());
        std::copy_n(line.text.begin(), slot.text_size, slot.text.begin());
        slot.turn.store(position + 1, std::memory_order_seq_cst);
        sleepers_.wake_one();
        return;
      }
    } else if (turn < position) {
      lost_.fetch_add(1, std::memory_order_relaxed);
      return;
    } else {
      position = tail_.load(std::memory_order_relaxed);
    }
  }
}

bool LogQueue::is_printed() const noexcept {
  const std::size_t tail = tail_.load(std::memory_order_acquire);
  return tail == 0 || slots_[(tail - 1) % kCapacity].turn.load(std::memory_order_acquire) >=
                          tail - 1 + kCapacity;
}

void LogQueue::set_listener(const void* who, Listener listener) {
  const std::lock_guard lock(listener_mutex_);
  std::erase_if(listeners_, [&](const auto& entry) { return entry.first == who; });
  if (listener) {
    listeners_.emplace_back(who, std::move(listener));
  }
}

bool LogQueue::has_line() const noexcept {
  return slots_[head_ % kCapacity].turn.load(std::memory_order_seq_cst) == head_ + 1;
}

void LogQueue::print(const LogLine& line) noexcept {
  const Time start = base::from_ns(start_ns_.load());
  const char* const colour = is_coloured_ ? colour_of(line.level) : "";
  std::fprintf(stderr, "%s%s%s%s%s%s\n", is_terminal_ ? "\r\x1b[K" : "",
               head_of(line, start).c_str(), colour, to_word(line.level),
               *colour == '\0' ? "" : "\x1b[0m", rest_of(line).c_str());
  notify(line);
}

void LogQueue::notify(const LogLine& line) noexcept {
  const std::lock_guard lock(listener_mutex_);
  for (const auto& [who, listener] : listeners_) {
    listener(line);
  }
}

void LogQueue::print_line() noexcept {
  Slot& slot = slots_[head_ % kCapacity];
  print({.time = slot.time,
         .level = slot.level,
         .component = {slot.component.data(), slot.component_size},
         .text = {slot.text.data(), slot.text_size}});
  slot.turn.store(head_ + kCapacity, std::memory_order_release);
  ++head_;
}

/// Logs how many lines found the queue full since the last call.
void LogQueue::report_lost() noexcept {
  const std::uint64_t lost = lost_.load(std::memory_order_relaxed);
  if (lost == reported_lost_) {
    return;
  }
  std::array<char, 128> text{};
  const auto written = fmt::format_to_n(text.data(), text.size(),
                                        "{} lines of log were lost: the queue of {} lines was full",
                                        lost - std::exchange(reported_lost_, lost), kCapacity);
  print({.time = clock_.now(),
         .level = LogLevel::kWarning,
         .component = kOwnName,
         .text = {text.data(), std::min(written.size, text.size())}});
  next_report_ns_ = base::monotonic_ns() + kReportNs;
}

void LogQueue::print_until_stopped() noexcept {
  for (;;) {
    while (has_line()) {
      print_line();
      if (lost_.load(std::memory_order_relaxed) != reported_lost_ &&
          base::monotonic_ns() >= next_report_ns_) {
        report_lost();
      }
    }
    std::fflush(stderr);
    sleepers_.announce(0);
    if (has_line()) {
      sleepers_.withdraw(0);
    } else if (is_stopping_.load()) {
      sleepers_.withdraw(0);
      report_lost();
      std::fflush(stderr);
      return;
    } else {
      sleepers_.sleep(0, base::kNever);
    }
  }
}

LogThrottle::Entry& LogThrottle::entry_of(const char* text) noexcept {
  for (std::size_t i = 0; i < kTexts; ++i) {
    Entry& entry = entries_[i];
    const char* known = entry.text.load(std::memory_order_relaxed);
    if (known == nullptr && entry.text.compare_exchange_strong(known, text)) {
      return entry;
    }
    if (known == text) {
      return entry;
    }
  }
  return entries_[kTexts];
}

std::optional<std::uint64_t> LogThrottle::admit(const char* text, Time now,
                                                Duration period) noexcept {
  Entry& entry = entry_of(text);
  const std::int64_t now_ns = base::to_ns(now);
  std::int64_t next_ns = entry.next_ns.load(std::memory_order_relaxed);
  if (now_ns < next_ns || !entry.next_ns.compare_exchange_strong(next_ns, base::to_ns(now + period),
                                                                 std::memory_order_relaxed)) {
    entry.left_out.fetch_add(1, std::memory_order_relaxed);
    return std::nullopt;
  }
  return entry.left_out.exchange(0, std::memory_order_relaxed);
}

void LogSource::write(LogLevel level, std::string_view component, std::string_view text) {
  if (!wants(level)) {
    return;
  }
  const Time time = now();
  const std::string_view source = component.empty() ? LogQueue::kOwnName : component;
  queue_.write({.time = time, .level = level, .component = source, .text = text});
  if (is_kept_.load(std::memory_order_relaxed)) {
    keep_line({.time = time,
               .level = level,
               .component = std::string(source),
               .text = std::string(text.substr(0, LogQueue::kTextBytes))});
  }
}

void LogSource::keep_line(Kept line) {
  if (!is_kept_.load(std::memory_order_relaxed)) {
    return;
  }
  const std::lock_guard lock(kept_mutex_);
  if (kept_.lines.size() == kMostKept) {
    ++kept_.lost;
  } else {
    kept_.lines.push_back(std::move(line));
  }
}

LogSource::AllKept LogSource::take_kept() {
  const std::lock_guard lock(kept_mutex_);
  return std::exchange(kept_, {});
}

void write_log(LogSource& source, LogLevel level, Duration period, fmt::string_view text,
               fmt::format_args args) {
  if (!source.wants(level)) {
    return;
  }
  std::uint64_t left_out = 0;
  if (period > Duration(0)) {
    const auto admitted = source.throttle().admit(text.data(), source.now(), period);
    if (!admitted) {
      return;
    }
    left_out = *admitted;
  }
  std::array<char, LogQueue::kTextBytes> line{};
  const auto end = fmt::vformat_to_n(line.data(), line.size(), text, args).out;
  auto size = static_cast<std::size_t>(end - line.data());
  if (left_out > 0) {
    // It stands even behind a long text.
    constexpr std::size_t kNote = 48;
    size = std::min(size, line.size() - kNote);
    const auto note = fmt::format_to_n(line.data() + size, kNote, " ({} more left out)", left_out);
    size = static_cast<std::size_t>(note.out - line.data());
  }
  source.write(level, {line.data(), size});
}

}  // namespace fastcycle::detail
