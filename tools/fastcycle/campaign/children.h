#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace fastcycle::tool {

/// A program to run: what it is called with, where it works, and where all goes that it prints.
struct ChildProgram {
  std::vector<std::string> arguments;  ///< The first is the program's file.
  std::filesystem::path folder;
  std::filesystem::path output;
};

/// How a child ended.
struct ChildEnd {
  bool is_late = false;  ///< It was killed, as it had not ended within its time.
  int exit_code = 0;     ///< If no signal ended it.
  int signal = 0;        ///< That ended it; 0 if none did.
  double wall_s = 0;
};

/// Runs programs beside each other, each in a process of its own, and a group of its own: Ctrl-C of
/// the terminal does not reach it.
///
/// @threads  `stop` is Safe; all else is confined.
class Children {
 public:
  Children(unsigned at_once, std::chrono::nanoseconds limit);
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;
  ~Children();

  /// Runs `count` programs, `begin(i)` each, and calls `ended` for each in the order in which they
  /// end. Returns early, with all children ended, once `stop` was called.
  void run(std::size_t count, const std::function<ChildProgram(std::size_t)>& begin,
           const std::function<void(std::size_t, const ChildEnd&)>& ended);

  /// Asks all children to end, and begins none any more.
  void stop() noexcept;
  [[nodiscard]] bool is_stopped() const noexcept { return is_stopped_; }

 private:
  const unsigned at_once_;
  const std::chrono::nanoseconds limit_;
  const int stop_event_;
  std::atomic<bool> is_stopped_{false};
};

}  // namespace fastcycle::tool
