#include "diagnostics/crash_reporter.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <exception>
#include <memory>
#include <new>
#include <typeinfo>
#include <utility>

#include <cxxabi.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/fork.h"
#include "base/log.h"
#include "broker/publisher_core.h"
#include "diagnostics/description.h"
#include "diagnostics/stack.h"
#include "executor/actor.h"
#include "fastcycle/assert.h"

namespace fastcycle::diagnostics {
namespace {

constexpr std::array kSignals{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
constexpr std::size_t kMaxComponents = 1024;  ///< Whose last activations are looked for.
constexpr std::uint64_t kMaxRecords =
    16 * 1024;  ///< That are looked at for that, over all workers.

/// The data of a run, prepared for the handlers.
struct Known {
  RunFacts facts;
  std::string file;  ///< Of the report; empty: none.
};

// The state of signal handlers and exit handlers, which have no arguments, and must not allocate.
struct State {
  std::atomic<bool> is_armed{false};
  std::atomic<const Known*> known{nullptr};
  std::atomic<pid_t> reporting{0};  ///< The thread that reports.
  pid_t process = 0;
  std::array<struct sigaction, kSignals.size()> before{};
  std::terminate_handler terminate_before = nullptr;
  std::new_handler new_before = nullptr;
  std::atomic<bool> is_out_of_memory{false};

  std::array<char, 512> last_words{};  ///< Of `std::terminate`; empty: it was not called.
  std::array<char, 64 * 1024> text{};
  std::array<char, 512> summary{};
  std::array<char, 1024> memory_text{};
  RawStack stack;
  std::array<Frame, kMaxFrames> frames{};
  std::array<detail::ActivationRecord, kMaxComponents> last{};
};
State g_state;

pid_t this_thread() noexcept {
  return static_cast<pid_t>(syscall(SYS_gettid));
}

bool is_of_this_run() noexcept {
  return g_state.is_armed.load() && !base::has_forked() && getpid() == g_state.process;
}

// ---- Words for signals ----

const char* name_of(int signal) noexcept {
  switch (signal) {
    case SIGSEGV:
      return "SIGSEGV";
    case SIGBUS:
      return "SIGBUS";
    case SIGFPE:
      return "SIGFPE";
    case SIGILL:
      return "SIGILL";
    default:
      return "SIGABRT";
  }
}

std::uintptr_t stack_pointer(const void* context) noexcept {
#if defined(__x86_64__)
  return static_cast<std::uintptr_t>(
      static_cast<const ucontext_t*>(context)->uc_mcontext.gregs[REG_RSP]);
#elif defined(__aarch64__)
  return static_cast<std::uintptr_t>(static_cast<const ucontext_t*>(context)->uc_mcontext.sp);
#else
  static_cast<void>(context);
  return 0;
#endif
}

/// Whether a call needed more stack than the thread has.
bool is_stack_overflow(const siginfo_t& info, const void* context) noexcept {
  constexpr std::uintptr_t kGuard = 64UL * 1024;
  const std::uintptr_t end = detail::running_activation.stack_end;
  const auto address = reinterpret_cast<std::uintptr_t>(info.si_addr);
  return end != 0 &&
         (stack_pointer(context) < end + 4096 || (address + kGuard > end && address < end + 4096));
}

void describe_fault(int signal, const siginfo_t& info, const void* context,
                    TextBuffer& text) noexcept {
  text << name_of(signal);
  if (info.si_code <= 0) {
    if (signal == SIGABRT && info.si_pid == getpid()) {
      text << ": abort() was called";
      if (g_state.last_words[0] != '\0') {
        text << " by " << g_state.last_words.data();
      }
      return;
    }
    if (info.si_pid == getpid()) {
      text << ", raised by the process itself";
    } else {
      text << ", sent by process " << info.si_pid;
    }
    return;
  }
  const auto address = reinterpret_cast<std::uintptr_t>(info.si_addr);
  if (signal == SIGSEGV && is_stack_overflow(info, context)) {
    text << ": the stack of the thread is used up (a recursion without end, or large local "
            "variables)";
  } else if (signal == SIGSEGV && address < 4096 && info.si_code == SEGV_MAPERR) {
    text << ": a null pointer was used";
  } else if (signal == SIGSEGV && info.si_code == SI_KERNEL) {
    text << ": an address was used that no memory can have, such as a pointer in memory that was "
            "given back";
    return;  // The kernel does not report which.
  } else if (signal == SIGSEGV && info.si_code == SEGV_MAPERR) {
    text << ": there is no memory at the address that was used";
  } else if (signal == SIGSEGV && info.si_code == SEGV_ACCERR) {
    text << ": the memory that was used is protected, such as constants that are written to";
  } else if (signal == SIGFPE && info.si_code == FPE_INTDIV) {
    text << ": an integer was divided by zero";
  } else if (signal == SIGILL) {
    text << ": an instruction that the processor does not have, such as of __builtin_trap() or at "
            "the end of a function that returns nothing although it should";
  } else if (signal == SIGBUS && info.si_code == BUS_ADRERR) {
    text << ": a file that is mapped there is shorter than that";
  } else {
    text << ", code " << info.si_code;
  }
  text << ", address " << Hex{address};
}

// ---- The report ----

/// A component whose library has some of the code that the thread was in: for threads outside of
/// the framework.
const RunFacts::Component* component_of_code(const Known& known,
                                             std::span<const Frame> frames) noexcept {
  for (const Frame& frame : frames) {
    if (frame.object == nullptr) {
      continue;
    }
    std::string_view name = frame.object->name;
    if (!name.starts_with("lib") || !name.ends_with(".so")) {
      continue;
    }
    name = name.substr(3, name.size() - 6);
    for (const RunFacts::Component& component : known.facts.components) {
      if (component.library == name) {
        return &component;
      }
    }
  }
  return nullptr;
}

void add_who(const Known* known, std::span<const Frame> frames, TextBuffer& text,
             TextBuffer& summary) noexcept {
  const detail::RunningActivation* const running = detail::current_activation();
  if (running != nullptr) {
    const detail::ActorBase& actor = *running->actor.load(std::memory_order_relaxed);
    text << "  component    \"" << actor.name << "\"\n  in           ";
    describe_call(*running, text);
    summary << "component \"" << actor.name << "\", in ";
    describe_call(*running, summary);
    const std::size_t before = text.size();
    text << "\n  given        ";
    const std::size_t after = text.size();
    describe_cause(*running, text);
    if (text.size() == after) {
      text.cut(before);
    }
    const std::uint64_t number = running->number.load(std::memory_order_relaxed);
    const std::int64_t begin_ns = running->begin_ns.load(std::memory_order_relaxed);
    text << "\n";
    if (number != 0) {
      text << "  activation   " << number << " of this component\n";
    }
    if (begin_ns != 0) {
      text << "  time in it   " << Span{base::monotonic_ns() - begin_ns} << "\n";
    }
  } else {
    text << "  component    none: the thread was in no call of a component\n";
    const RunFacts::Component* const component =
        known == nullptr ? nullptr : component_of_code(*known, frames);
    if (component != nullptr) {
      text << "               it runs code of the library of component \"" << component->name
           << "\", probably a thread that it made itself\n";
      summary << "component \"" << component->name << "\", in a thread that it made itself";
    } else {
      summary << "no component";
    }
  }
  char name[17] = {};
  prctl(PR_GET_NAME, name);
  text << "  thread       " << Foreign{name} << " (" << this_thread() << ")\n";
}

void add_stack(std::span<const Frame> frames, TextBuffer& text) noexcept {
  text << "  stack\n";
  std::size_t repeated = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i >= 2 && i + 1 < frames.size() && frames[i].address == frames[i - 1].address) {
      ++repeated;
      continue;
    }
    if (repeated > 0) {
      text << "         ... the same " << std::exchange(repeated, 0) << " times more\n";
    }
    text << "    #" << i << (i < 10 ? "   " : "  ") << frames[i] << "\n";
  }
  text << "  build ids\n";
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const LoadedObject* const object = frames[i].object;
    const bool is_new = std::ranges::none_of(
        frames.first(i), [&](const Frame& frame) { return frame.object == object; });
    if (object != nullptr && is_new) {
      text << "    " << (object->build_id.empty() ? "(none)" : std::string_view(object->build_id))
           << "  " << object->path << "\n";
    }
  }
}

void add_activation(const Known& known, const detail::ActivationRecord& record,
                    TextBuffer& text) noexcept {
  text << "    ";
  if (record.component < known.facts.components.size()) {
    text << known.facts.components[record.component].name;
  } else {
    text << "component " << record.component;
  }
  text << ": " << record.number << ", ";
  const auto publisher =
      std::ranges::find(known.facts.publishers, record.publisher, &RunFacts::Publisher::id);
  if (record.publisher != 0 && publisher != known.facts.publishers.end()) {
    text << "message " << record.key << " of \"" << publisher->topic << "\" from \""
         << publisher->component << "\"";
  } else if (record.cause == detail::Cause::kTick) {
    text << "tick of timer " << record.key;
  } else {
    text << detail::to_word(record.cause);
  }
  text << ", began " << Span{base::monotonic_ns() - record.begin_ns} << " ago, ";
  if (record.outcome == detail::Outcome::kRunning) {
    text << "has not ended\n";
  } else {
    text << (record.outcome == detail::Outcome::kFault ? "threw" : "took") << " "
         << (record.outcome == detail::Outcome::kFault ? "after " : "") << Span{record.duration_ns}
         << "\n";
  }
}

/// The last activation of each component.
void add_activations(const Known& known, TextBuffer& text) noexcept {
  const std::size_t count = std::min(known.facts.components.size(), kMaxComponents);
  for (std::size_t i = 0; i < count; ++i) {
    g_state.last[i].number = 0;
  }
  const std::uint64_t per_ring =
      std::min<std::uint64_t>(kMaxRecords / std::max<std::size_t>(known.facts.rings.size(), 1),
                              detail::ActivationRing::kCapacity);
  for (const detail::ActivationRing* ring : known.facts.rings) {
    const std::uint64_t end = ring->size();
    for (std::uint64_t place = end; place > end - std::min(end, per_ring); --place) {
      detail::ActivationRecord record;
      if (ring->read_at(place - 1, record) && record.component < count &&
          record.number > g_state.last[record.component].number) {
        g_state.last[record.component] = record;
      }
    }
  }
  text << "  last activations\n";
  for (std::size_t i = 0; i < count; ++i) {
    if (g_state.last[i].number != 0) {
      add_activation(known, g_state.last[i], text);
    }
  }
}

/// The publishers with the most messages.
void add_memory(const Known& known, TextBuffer& text) noexcept {
  text << "  messages in memory, of the publishers with the most\n";
  std::uint64_t below = UINT64_MAX;
  for (int line = 0; line < 8; ++line) {
    std::uint64_t most = 0;
    for (const RunFacts::Publisher& publisher : known.facts.publishers) {
      const std::uint64_t count = publisher.core == nullptr ? 0 : publisher.core->allocated();
      most = count < below ? std::max(most, count) : most;
    }
    if (most == 0) {
      return;
    }
    for (const RunFacts::Publisher& publisher : known.facts.publishers) {
      if (publisher.core != nullptr && publisher.core->allocated() == most) {
        text << "    " << most << " of \"" << publisher.topic << "\" from \"" << publisher.component
             << "\"\n";
      }
    }
    below = most;
  }
}

void write_all(int file, std::string_view text) noexcept {
  while (!text.empty()) {
    pollfd ready{.fd = file, .events = POLLOUT, .revents = 0};
    constexpr int kLongestMs =
        1000;  // A reader that does not read must not keep the process from ending.
    if (poll(&ready, 1, kLongestMs) == 0) {
      return;
    }
    const ssize_t count = write(file, text.data(), text.size());
    if (count < 0 && errno != EINTR) {
      return;
    }
    text.remove_prefix(count < 0 ? 0 : static_cast<std::size_t>(count));
  }
}

void leave_note(CrashNote& note, std::string_view summary, std::string_view text) noexcept {
  const detail::RunningActivation* const running = detail::current_activation();
  if (running != nullptr) {
    TextBuffer name(std::span(note.component).first(note.component.size() - 1));
    name << running->actor.load(std::memory_order_relaxed)->name;
    if (running->record != nullptr) {
      note.activation = *running->record;
      note.activation.outcome = detail::Outcome::kRunning;
      note.activation.duration_ns =
          base::monotonic_ns() - running->begin_ns.load(std::memory_order_relaxed);
    }
  }
  TextBuffer(std::span(note.summary).first(note.summary.size() - 1)) << summary;
  TextBuffer beginning(note.text);
  beginning << text;
  note.text_size = static_cast<std::uint32_t>(beginning.size());
  std::atomic_thread_fence(std::memory_order_release);
  note.magic = CrashNote::kMagic;
}

/// Lets the log's own thread print what waits; not for long, as it may wait for this one.
void wait_for_lines(const detail::LogQueue& log) noexcept {
  constexpr int kLongestMs = 100;
  for (int i = 0; i < kLongestMs && !log.is_printed(); ++i) {
    const timespec some{.tv_sec = 0, .tv_nsec = 1'000'000};
    nanosleep(&some, nullptr);
  }
}

/// Whether that is how the report itself was called.
bool is_own(const Frame& frame) noexcept {
  return std::string_view(frame.function.data()).starts_with("fastcycle::diagnostics::");
}

/// Writes the report of the calling thread. `what` is the reason, `context` where a signal
/// interrupted it.
void report(std::string_view what, const void* context) noexcept {
  const std::int64_t began_ns = base::monotonic_ns();
  const Known* const known = g_state.known.load();
  TextBuffer text(g_state.text);
  TextBuffer summary(g_state.summary);
  read_stack(context, g_state.stack);
  const std::size_t count = to_frames(g_state.stack, g_state.frames);
  auto frames = std::span<const Frame>(g_state.frames).first(count);
  while (!frames.empty() && is_own(frames.front())) {
    frames = frames.subspan(1);
  }
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);

  text << "\nfastcycle: crash report\n  application  \""
       << (known == nullptr ? "?" : std::string_view(known->facts.application)) << "\", process "
       << g_state.process << ", " << now.tv_sec << " s after 1970\n  what         " << what << "\n";
  add_who(known, frames, text, summary);
  summary << ": " << what;
  add_stack(frames, text);
  if (known != nullptr) {
    add_activations(*known, text);
    if (g_state.is_out_of_memory.load()) {
      add_memory(*known, text);
    }
  }
  int file = -1;
  if (known != nullptr && !known->file.empty()) {
    file = open(known->file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
                S_IRUSR | S_IWUSR);
  }
  text << "  made in      " << Span{base::monotonic_ns() - began_ns} << "\n";
  if (file >= 0) {
    write_all(file, text.text());
    close(file);
    text << "  written to   " << known->file << "\n";
  }
  text << "fastcycle: crash of " << summary.text() << "\n";
  write_all(STDERR_FILENO, text.text());
  if (const detail::RunningActivation* const running = detail::current_activation();
      known != nullptr && known->facts.crashed != nullptr && running != nullptr &&
      running->record != nullptr) {
    known->facts.crashed->store(running->record->component + 1);
  }
  if (known != nullptr && known->facts.note != nullptr) {
    leave_note(*known->facts.note, summary.text(), text.text());
  }
  if (known != nullptr && known->facts.log != nullptr) {
    wait_for_lines(*known->facts.log);
  }
}

/// Whether the calling thread is the one to report; another one that crashes meanwhile waits for
/// the end of the process, for 5 s at most.
bool begin_report() noexcept {
  pid_t nobody = 0;
  const pid_t self = this_thread();
  if (g_state.reporting.compare_exchange_strong(nobody, self)) {
    return true;
  }
  if (nobody == self) {
    constexpr std::string_view kCut =
        "\nfastcycle: the crash report is cut short: it crashed itself\n";
    const std::size_t size = strnlen(g_state.text.data(), g_state.text.size());
    write_all(STDERR_FILENO, {g_state.text.data(), size});
    write_all(STDERR_FILENO, kCut);
    return false;
  }
  for (int i = 0; i < 500; ++i) {
    const timespec some{.tv_sec = 0, .tv_nsec = 10'000'000};
    nanosleep(&some, nullptr);
  }
  return false;
}

void on_signal(int signal, siginfo_t* info, void* context) {
  const int error = errno;
  if (is_of_this_run() && begin_report()) {
    std::array<char, 700> what{};
    TextBuffer text(what);
    describe_fault(signal, *info, context, text);
    report(text.text(), context);
  }
  // Then the default action follows: the instruction is retried, or the signal sent again.
  const auto place = std::ranges::find(kSignals, signal) - kSignals.begin();
  sigaction(signal, &g_state.before[static_cast<std::size_t>(place)], nullptr);
  if (info->si_code <= 0) {
    syscall(SYS_tgkill, getpid(), this_thread(), signal);
  }
  errno = error;
}

[[noreturn]] void on_terminate() {
  if (is_of_this_run()) {
    TextBuffer text(std::span(g_state.last_words).first(g_state.last_words.size() - 1));
    text << "std::terminate";
    if (const std::type_info* type = abi::__cxa_current_exception_type()) {
      text << ": nobody caught ";
      std::array<char, 256> symbol{};
      TextBuffer mangled(symbol);
      mangled << "_Z" << type->name();
      const bool is_named = type->name()[1] != '\0';
      if (is_named) {
        demangle(mangled.text(), text);
      } else {
        text << "something of the type " << (*type == typeid(int) ? "int" : type->name());
      }
      try {
        throw;
      } catch (const std::exception& exception) {
        text << " \"" << Foreign{exception.what()} << "\"";
      } catch (...) {  // It has no text.
      }
    }
  }
  std::abort();
}

std::uint64_t resident_bytes() noexcept {
  std::array<char, 128> content{};
  const int file = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  if (file < 0) {
    return 0;
  }
  const ssize_t count = read(file, content.data(), content.size() - 1);
  close(file);
  const char* const resident = count <= 0 ? nullptr : std::strchr(content.data(), ' ');
  return resident == nullptr ? 0 : std::strtoull(resident, nullptr, 10) * 4096;
}

/// Called when an allocation fails: reports the first one.
void on_no_memory() {
  if (is_of_this_run() && !g_state.is_out_of_memory.exchange(true)) {
    TextBuffer text(g_state.memory_text);
    text << "\nfastcycle: no memory is left for ";
    if (const detail::RunningActivation* running = detail::current_activation()) {
      text << "component \"" << running->actor.load(std::memory_order_relaxed)->name << "\", in ";
      describe_call(*running, text);
    } else {
      char name[17] = {};
      prctl(PR_GET_NAME, name);
      text << "thread " << Foreign{name};
    }
    text << ": the process has " << resident_bytes() / 1'000'000 << " MB";
    rlimit limit{};
    if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
      text << ", and may map " << limit.rlim_cur / 1'000'000 << " MB";
    }
    text << "\n";
    if (const Known* known = g_state.known.load()) {
      add_memory(*known, text);
    }
    write_all(STDERR_FILENO, text.text());
  }
  throw std::bad_alloc();
}

/// Reports that code ends the process during a run, and ends it.
[[noreturn]] void end_reported(std::string_view call, int code) noexcept {
  if (begin_report()) {
    std::array<char, 128> what{};
    TextBuffer text(what);
    text << call;
    if (code >= 0) {
      text << "(" << code << ")";
    } else {
      text << "()";
    }
    text << " was called while the application runs";
    report(text.text(), nullptr);
  }
  end_process(1);
}

void on_exit_of_process(int code, void*) {
  if (!g_state.is_armed.load()) {
    return;
  }
  if (!is_of_this_run()) {  // A child, which has nothing of what would be destroyed now.
    std::fflush(stdout);
    end_process(code);
  }
  end_reported("exit", code);
}

void on_quick_exit() {
  if (is_of_this_run()) {
    end_reported("quick_exit", -1);
  }
}

std::string file_name_of(const RunFacts& facts) {
  std::string name = facts.application;
  for (char& c : name) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '_' || c == '-';
    c = is_plain ? c : '_';
  }
  return "fastcycle-crash-" + name.substr(0, 100) + "-" + std::to_string(getpid()) + ".txt";
}

/// Of all reporters; a handler may still look at one that is gone.
std::deque<std::unique_ptr<const Known>>& all_known() {
  static auto& all = *new std::deque<std::unique_ptr<const Known>>;
  return all;
}

}  // namespace

CrashReporter::CrashReporter() {
  FASTCYCLE_ASSERT(!g_state.is_armed.load(), "one crash reporter at a time");
  note_loaded_objects();
  prepare_stacks();
  base::watch_forks();
  g_state.process = getpid();
  g_state.reporting.store(0);
  static const bool has_exit_handlers =
      on_exit(&on_exit_of_process, nullptr) == 0 && at_quick_exit(&on_quick_exit) == 0;
  static_cast<void>(has_exit_handlers);
  g_state.terminate_before = std::set_terminate(&on_terminate);
  g_state.new_before = std::set_new_handler(&on_no_memory);
  struct sigaction action{};
  action.sa_sigaction = &on_signal;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], &action, &g_state.before[i]);
  }
  g_state.is_armed.store(true);
}

CrashReporter::~CrashReporter() {
  g_state.is_armed.store(false);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], &g_state.before[i], nullptr);
  }
  std::set_new_handler(g_state.new_before);
  std::set_terminate(g_state.terminate_before);
  g_state.known.store(nullptr);
}

void CrashReporter::know(RunFacts facts) {
  note_loaded_objects();
  auto known = std::make_unique<Known>();
  if (!facts.folder.empty()) {
    std::error_code error;
    const std::filesystem::path folder = std::filesystem::absolute(facts.folder, error);
    known->file = error ? "" : (folder / file_name_of(facts)).lexically_normal().string();
  }
  known->facts = std::move(facts);
  g_state.known.store(known.get());
  all_known().push_back(std::move(known));
}

void end_process(int exit_code) noexcept {
  for (;;) {
    syscall(SYS_exit_group, exit_code);
  }
}

void report_and_end(const char* reason, int exit_code) noexcept {
  if (is_of_this_run() && begin_report()) {
    report(reason, nullptr);
  }
  end_process(exit_code);
}

namespace {

/// Replaces `_exit` in this process, except under a sanitizer, which replaces it itself.
[[noreturn, maybe_unused]] void leave(const char* call, int code, const void* caller) noexcept {
  if (is_of_this_run()) {
    // Calls of the framework itself, and of the program, are intended.
    const LoadedObject* const object = find_object(reinterpret_cast<std::uintptr_t>(caller));
    const LoadedObject* const own = find_object(reinterpret_cast<std::uintptr_t>(&end_process));
    const bool is_own = object == nullptr || object == own || object->is_program;
    if (!is_own) {
      end_reported(call, code);
    }
  }
  end_process(code);
}

}  // namespace
}  // namespace fastcycle::diagnostics

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// Libraries of components find these before those of the C library: a component that ends the
// process is named.
extern "C" {
__attribute__((noreturn, visibility("default"))) void _exit(int code) {
  fastcycle::diagnostics::leave("_exit", code, __builtin_return_address(0));
}
__attribute__((noreturn, visibility("default"))) void _Exit(int code) noexcept {
  fastcycle::diagnostics::leave("_Exit", code, __builtin_return_address(0));
}
}
#endif
