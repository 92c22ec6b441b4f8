#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

namespace fastcycle::launcher {

/// The program `fastcycle`, started with some arguments, its output as it comes.
///
/// All waits are bounded: after a minute the program is killed, and the test sees what it had said.
///
/// @threads  Confined to the test.
class Program {
 public:
  explicit Program(const std::vector<std::string>& arguments);
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program();

  /// Waits until standard error contains `text`; false if it never did.
  [[nodiscard]] bool wait_for_error_text(const std::string& text);

  void send(int signal) const;

  /// Waits for its end, and for the end of its output. Returns the exit code; 1000 + the number of
  /// the signal that ended it.
  int wait();

  // Complete after `wait`.
  [[nodiscard]] std::string output() const;
  [[nodiscard]] std::string errors() const;

 private:
  void read(int descriptor, std::string& text);

  pid_t pid_ = -1;
  bool is_reaped_ = false;
  int exit_code_ = -1;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int open_ = 2;  ///< Streams that are still read.
  std::string output_;
  std::string errors_;

  std::thread output_reader_;
  std::thread errors_reader_;
};

}  // namespace fastcycle::launcher
