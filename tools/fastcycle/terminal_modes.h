#pragma once

namespace fastcycle::tool {

/// Sets the terminal of standard input to deliver keys as they are pressed, without echo.
///
/// Ctrl-C and Ctrl-Z work as usual. The terminal is restored on destruction, when a signal ends the
/// process, and while it is stopped. At most one instance exists at a time.
///
/// @threads  Confined to its owner.
class TerminalModes {
 public:
  /// Whether standard input is a terminal, and this process is in its foreground.
  [[nodiscard]] static bool are_there();
  [[nodiscard]] static bool are_in_foreground() noexcept;
  /// Restores the terminal before the process is ended immediately. Safe in signal handlers.
  static void give_back() noexcept;
  /// How often the terminal was taken, including each time a stopped process continues.
  [[nodiscard]] static int times_taken() noexcept;
  /// Whether the terminal is ours now: not while the process is stopped, or in the background.
  [[nodiscard]] static bool are_taken() noexcept;

  /// The strings written to standard output whenever the terminal is taken, and before it is given
  /// back; both must outlive this.
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
