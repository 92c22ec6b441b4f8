#pragma once

#include <chrono>
#include <csignal>
#include <optional>
#include <string>
#include <vector>

#include "terminal_modes.h"
#include "top/keys.h"
#include "top/screen.h"

namespace fastcycle::tool::top {

struct TerminalSize {
  int width = 80;
  int height = 24;
};

/// The size of the terminal at standard output; 80 × 24 if it is unknown.
[[nodiscard]] TerminalSize terminal_size();

/// How standard output displays a screen, from the environment: NO_COLOR, TERM, LC_ALL, LC_CTYPE,
/// LANG.
[[nodiscard]] Look look_of_environment();

/// Takes over the whole terminal. Its previous contents are restored on destruction, on every way
/// out.
///
/// @threads  Confined to the thread that constructed it. Its signals are blocked in that thread and
///           in those that it creates afterwards, and are delivered while `wait` waits.
class Terminal {
 public:
  /// Whether standard input and output are both a terminal with cursor control.
  [[nodiscard]] static bool is_there();

  explicit Terminal(const Look& look);
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal();

  /// Shows `screen`: writes only what differs from the previous one.
  void show(const Screen& screen);

  /// Events that occurred during `wait`.
  struct Event {
    std::vector<Key> keys = {};
    bool is_over = false;  ///< A signal requests the end, or the terminal is gone.
  };
  /// Waits for keys, a size change, or `descriptor` to become readable, for at most `patience`.
  [[nodiscard]] Event wait(int descriptor, std::chrono::milliseconds patience);

 private:
  void read_keys(std::vector<Key>& keys);
  [[nodiscard]] bool has_input(std::chrono::milliseconds patience) const;

  const Look look_;
  sigset_t signals_before_{};
  std::optional<TerminalModes> modes_;
  std::optional<Screen> shown_;
  int taken_ = 0;  ///< `TerminalModes::times_taken` when it was shown.
  KeyReader reader_;
  bool is_gone_ = false;
};

}  // namespace fastcycle::tool::top
