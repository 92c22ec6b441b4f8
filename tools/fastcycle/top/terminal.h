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

/// How big the terminal at standard output is; 80 × 24 if it does not say.
[[nodiscard]] TerminalSize terminal_size();

/// How standard output shows a screen, by the environment: NO_COLOR, TERM, LC_ALL, LC_CTYPE, LANG.
[[nodiscard]] Look look_of_environment();

/// The whole terminal, with what was on it put aside: it is there again when this is gone, on every
/// way out.
///
/// @threads  Confined to the thread that made it. Signals that concern it are blocked in that
///           thread and in those that it makes afterwards, and come while `wait` waits.
class Terminal {
 public:
  /// Whether both standard input and output are a terminal that can show more than lines.
  [[nodiscard]] static bool is_there();

  explicit Terminal(const Look& look);
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal();

  /// Shows `screen`: writes what differs from the one before.
  void show(const Screen& screen);

  /// What came while one waited.
  struct Event {
    std::vector<Key> keys = {};
    bool is_over = false;  ///< A signal asks for the end, or the terminal is gone.
  };
  /// Waits for keys, for another size, for `descriptor` to be readable, and at most for `patience`.
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
