#pragma once

namespace fastcycle::tool {

/// The terminal of standard input gives keys one by one as they are pressed, without showing them.
///
/// Ctrl-C and Ctrl-Z do what they always do. The terminal is as it was before when this is gone,
/// when a signal ends the process, and while it is stopped. There is one at a time.
///
/// @threads  Confined to its owner.
class TerminalModes {
 public:
  /// Whether standard input is a terminal, and this process in its foreground.
  [[nodiscard]] static bool are_there();
  [[nodiscard]] static bool are_in_foreground() noexcept;
  /// Makes the terminal as it was before; for who ends the process at once. Safe in signal
  /// handlers.
  static void give_back() noexcept;
  /// How often the terminal was taken: once more when a stopped process goes on.
  [[nodiscard]] static int times_taken() noexcept;
  /// Whether the terminal is ours now: not while the process is stopped, or in the background.
  [[nodiscard]] static bool are_taken() noexcept;

  /// What standard output gets whenever the terminal is taken, and before it is given back; both
  /// must live as long as this.
  explicit TerminalModes(const char* on_take = "", const char* on_give_back = "");
  TerminalModes(const TerminalModes&) = delete;
  TerminalModes& operator=(const TerminalModes&) = delete;
  ~TerminalModes();

  /// Whether the terminal could be taken at all.
  explicit operator bool() const { return is_good_; }

 private:
  bool is_good_ = false;
};

}  // namespace fastcycle::tool
