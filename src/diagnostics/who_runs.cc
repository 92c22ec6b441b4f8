#include "diagnostics/who_runs.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <span>
#include <string_view>

#include <fmt/format.h>
#include <semaphore.h>
#include <signal.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "diagnostics/description.h"
#include "diagnostics/stack.h"
#include "executor/activation.h"

namespace fastcycle::diagnostics {
namespace {

/// A query to a thread, and its answer, in preallocated memory.
struct Question {
  enum class Stage : std::uint8_t { kNone, kAsked, kAnswering, kAnswered };

  std::atomic<Stage> stage{Stage::kNone};
  std::atomic<pid_t> thread{0};
  sem_t answered{};

  std::int64_t begin_ns = 0;
  bool is_running = false;
  std::array<char, 512> call{};
  std::array<char, 512> given{};
  RawStack stack;
};

// A signal handler is given nothing else.
Question g_question;

/// Rarely used by anyone: not among the first real-time signals, nor the last ones.
int question_signal() noexcept {
  return SIGRTMIN + 13;
}

void answer(int, siginfo_t*, void* context) {
  const int error = errno;
  Question& question = g_question;
  auto asked = Question::Stage::kAsked;
  if (question.thread.load() == static_cast<pid_t>(syscall(SYS_gettid)) &&
      question.stage.compare_exchange_strong(asked, Question::Stage::kAnswering)) {
    const detail::RunningActivation* const running = detail::current_activation();
    question.is_running = running != nullptr;
    if (running != nullptr) {
      question.begin_ns = running->begin_ns.load(std::memory_order_relaxed);
      TextBuffer call(std::span(question.call).first(question.call.size() - 1));
      describe_call(*running, call);
      TextBuffer given(std::span(question.given).first(question.given.size() - 1));
      describe_cause(*running, given);
      read_stack(context, question.stack);
    }
    question.stage.store(Question::Stage::kAnswered);
    sem_post(&question.answered);
  }
  errno = error;
}

bool prepare() {
  static const bool is_ready = [] {
    prepare_stacks();
    struct sigaction action{};
    action.sa_sigaction = &answer;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK | SA_RESTART;
    sigemptyset(&action.sa_mask);
    return sem_init(&g_question.answered, 0, 0) == 0 &&
           sigaction(question_signal(), &action, nullptr) == 0;
  }();
  return is_ready;
}

/// Fills in `call` from what was answered.
void take_answer(RunningCall& call) {
  Question& question = g_question;
  if (!question.is_running || question.begin_ns != call.begin_ns) {
    call.actor = nullptr;  // It has returned meanwhile.
    return;
  }
  call.call = question.call.data();
  call.given = question.given.data();
  note_loaded_objects();
  std::array<Frame, kMaxFrames> frames;
  const std::size_t count = to_frames(question.stack, frames);
  for (const Frame& frame : std::span(frames).first(count)) {
    std::array<char, 512> line{};
    TextBuffer text(line);
    text << frame;
    call.stack.emplace_back(text.text());
  }
}

/// Whether an answer came within 1 s.
bool wait_for_answer() {
  timespec limit{};
  clock_gettime(CLOCK_REALTIME, &limit);
  limit.tv_sec += 1;
  while (sem_timedwait(&g_question.answered, &limit) != 0) {
    if (errno != EINTR) {
      // From now on a late answer is not wanted; one that is being given is waited for.
      auto asked = Question::Stage::kAsked;
      if (g_question.stage.compare_exchange_strong(asked, Question::Stage::kNone)) {
        return false;
      }
      limit.tv_sec += 1;
    }
  }
  return true;
}

/// Makes the thread `id` report what it does, if it still is in the call that began at `begin_ns`.
void ask(pid_t id, RunningCall& call) {
  Question& question = g_question;
  std::ranges::fill(question.call, '\0');
  std::ranges::fill(question.given, '\0');
  question.is_running = false;
  question.thread.store(id);
  question.stage.store(Question::Stage::kAsked);
  if (syscall(SYS_tgkill, getpid(), id, question_signal()) != 0 || !wait_for_answer()) {
    question.stage.store(Question::Stage::kNone);
    return;
  }
  question.stage.store(Question::Stage::kNone);
  take_answer(call);
}

bool is_of_the_system(std::string_view frame) {
  static constexpr std::array<std::string_view, 7> kNames{
      "(libc.so",  "(libstdc++.so", "(libfastcycle.so", "(libpthread",
      "(ld-linux", "([vdso]",       "(linux-vdso"};
  return std::ranges::any_of(
      kNames, [&](std::string_view name) { return frame.find(name) != std::string_view::npos; });
}

}  // namespace

std::string RunningCall::place() const {
  if (stack.empty()) {
    return "a place that its thread does not report: it blocks all signals";
  }
  std::string text = stack.front();
  const auto own = std::ranges::find_if_not(stack, is_of_the_system);
  if (own != stack.end() && own != stack.begin()) {
    text += ", called by " + *own;
  }
  return text;
}

std::size_t RunningCall::own_frames() const {
  const auto last = std::find_if_not(stack.rbegin(), stack.rend(), is_of_the_system);
  return static_cast<std::size_t>(stack.rend() - last);
}

std::string RunningCall::in_words() const {
  std::string more = given;
  if (activation != 0) {
    more += fmt::format("{}activation {}", more.empty() ? "" : ", ", activation);
  }
  return fmt::format("{}{}{}{} has not returned for {:.1f} s", call, more.empty() ? "" : " (", more,
                     more.empty() ? "" : ")", std::chrono::duration<double>(time).count());
}

std::vector<RunningCall> who_runs_now(std::chrono::nanoseconds least,
                                      const std::function<bool(const RunningCall&)>& is_wanted) {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  std::vector<std::pair<pid_t, RunningCall>> found;
  const std::int64_t now_ns = base::monotonic_ns();
  detail::for_each_serving_thread([&](const detail::ServingThreadView& view) {
    RunningCall call;
    call.begin_ns = view.running.begin_ns.load(std::memory_order_acquire);
    call.actor = view.running.actor.load(std::memory_order_acquire);
    call.activation = view.running.number.load(std::memory_order_acquire);
    const char* const words = view.running.call.load(std::memory_order_acquire);
    call.time = std::chrono::nanoseconds(now_ns - call.begin_ns);
    if (call.actor == nullptr || call.begin_ns == 0 || call.time < least ||
        view.running.begin_ns.load(std::memory_order_acquire) != call.begin_ns ||
        view.running.actor.load(std::memory_order_acquire) != call.actor) {
      return;
    }
    call.call = words == nullptr ? "its callback" : words;
    call.is_lifecycle = words != nullptr && !call.call.starts_with("its callback");
    std::array<char, 17> name{};
    pthread_getname_np(view.thread, name.data(), name.size());
    call.thread = fmt::format("{} ({})", name.data(), view.id);
    found.emplace_back(view.id, std::move(call));
  });
  std::erase_if(found, [&](const auto& entry) { return !is_wanted(entry.second); });
  std::vector<RunningCall> calls;
  for (auto& [id, call] : found) {
    if (prepare()) {
      ask(id, call);
    }
    if (call.actor != nullptr) {
      calls.push_back(std::move(call));
    }
  }
  std::ranges::sort(calls, std::greater{}, &RunningCall::time);
  return calls;
}

}  // namespace fastcycle::diagnostics
