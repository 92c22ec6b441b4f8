#include "stop_signals.h"

#include <utility>

#include <pthread.h>
#include <unistd.h>

#include "command.h"
#include "diagnostics/crash_reporter.h"
#include "terminal_modes.h"

namespace fastcycle::tool {

sigset_t block_stop_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGUSR1);
  struct sigaction hang_up{};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler != SIG_IGN) {
    sigaddset(&signals, SIGHUP);
  }
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

StopSignals::StopSignals(const sigset_t& signals, std::function<void()> on_first,
                         std::function<void()> on_user)
    : signals_(signals),
      on_first_(std::move(on_first)),
      on_user_(std::move(on_user)),
      thread_([this] { wait(); }) {}

StopSignals::~StopSignals() {
  is_over_ = true;
  // To that thread alone, so that it is woken although it sleeps in the kernel.
  pthread_kill(thread_.native_handle(), SIGTERM);
  thread_.join();
}

void StopSignals::wait() {
  for (bool is_first = true;;) {
    int signal = 0;
    sigwait(&signals_, &signal);
    if (is_over_) {
      return;
    }
    if (signal == SIGUSR1) {
      on_user_();
      continue;
    }
    if (!is_first) {
      TerminalModes::give_back();
      diagnostics::end_process(kEndedAtOnce);
    }
    is_first = false;
    on_first_();
  }
}

}  // namespace fastcycle::tool
