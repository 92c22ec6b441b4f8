#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace fastcycle::tool {

/// A program to run: its arguments, its working folder, and the file that gets its output.
struct ChildProgram {
  std::vector<std::string> arguments;  ///< The first is the program's file.
  std::filesystem::path folder;
  std::filesystem::path output;
};

/// How a child ended.
struct ChildEnd {
  bool is_late = false;  ///< It was killed because it exceeded its time limit.
  int exit_code = 0;     ///< Valid if no signal ended it.
  int signal = 0;        ///< The signal that ended it; 0 if none.
  double wall_s = 0;
};

/// Runs programs concurrently, each in its own process and process group, so that Ctrl-C in the
/// terminal does not reach it.
///
/// @threads  `stop` is Safe; all else is confined.
class Children {
 public:
  Children(unsigned at_once, std::chrono::nanoseconds limit);
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;
  ~Children();

  /// Runs `count` programs, described by `begin(i)`, and calls `ended` for each in the order in
  /// which they end. Returns early, with all children ended, once `stop` has been called.
  void run(std::size_t count, const std::function<ChildProgram(std::size_t)>& begin,
           const std::function<void(std::size_t, const ChildEnd&)>& ended);

  /// Asks all children to end, and starts no further ones.
  void stop() noexcept;
  [[nodiscard]] bool is_stopped() const noexcept { return is_stopped_; }

 private:
  const unsigned at_once_;
  const std::chrono::nanoseconds limit_;
  const int stop_event_;
  std::atomic<bool> is_stopped_{false};
};

}  // namespace fastcycle::tool
