#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <poll.h>
#include <sys/types.h>

namespace fastcycle::test {

/// The uid and gid that has no rights, for tests that start as root.
inline constexpr unsigned kNobody = 65534;

/// How a program is started.
struct ProcessOptions {
  std::filesystem::path program = {};
  std::vector<std::string> arguments = {};
  std::filesystem::path folder = {};          ///< Where it works; empty: where the test does.
  std::vector<std::string> environment = {};  ///< "NAME=value", beside what the test has.
  bool is_ordinary_user = false;              ///< See `become_ordinary_user`.
  bool is_traced = false;       ///< It asks to be traced by the test before it starts.
  bool has_no_streams = false;  ///< Its standard streams are closed, not read.
  bool may_dump_core = false;   ///< `ulimit -c unlimited`; else what the test has.
};

/// How a program ended.
struct Ending {
  int exit_code = -1;         ///< -1: by a signal.
  int signal = 0;             ///< 0: by itself.
  bool has_dumped = false;    ///< The kernel wrote a core dump.
  bool was_too_late = false;  ///< The test had to end it, after `kLongest`.
};

/// A program in a process and a session of its own, its output as it comes.
///
/// All waits are bounded: after `kLongest` the program is killed. It does not outlive the test.
///
/// @threads  Confined to the test.
class Process {
 public:
  static constexpr std::chrono::seconds kLongest{180};

  explicit Process(const ProcessOptions& options);
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  [[nodiscard]] pid_t pid() const { return pid_; }
  void send(int signal) const;

  /// Waits until output or errors contain `text`; false if they ended or `kLongest` passed before.
  [[nodiscard]] bool wait_for(const std::string& text);

  /// Waits for its end. What its children still write is not waited for.
  const Ending& wait();

  [[nodiscard]] const std::string& output() const { return output_; }
  [[nodiscard]] const std::string& errors() const { return errors_; }

 private:
  void start(const ProcessOptions& options, int output, int errors) const;
  void read_once(int timeout_ms);
  [[nodiscard]] bool try_reap();

  const std::chrono::steady_clock::time_point limit_;
  pid_t pid_ = -1;
  bool has_ended_ = false;
  Ending ending_;
  pollfd streams_[2] = {};
  std::string output_;
  std::string errors_;
};

/// A folder that every user may use, removed with its content.
class Folder {
 public:
  Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const {
    return path_ / name;
  }
  std::filesystem::path write(const std::string& name, const std::string& content) const;

 private:
  std::filesystem::path path_;
};

[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// How many processes there are in the session that `leader` leads or led.
[[nodiscard]] int processes_of_session(pid_t leader);
/// The one of them with this name, cut to 15 characters; 0 if there is none.
[[nodiscard]] pid_t process_of_session(pid_t leader, const std::string& name);

/// Gives up root, if the process is root: all ids become `id`, no capability and no further
/// group is left. For a process that was made for it. False if that is not possible.
[[nodiscard]] bool become_ordinary_user(unsigned id = kNobody);

/// What `body` returns, run in a process of its own as an ordinary user; "" if it was killed.
[[nodiscard]] std::string as_ordinary_user(const std::function<std::string()>& body,
                                           unsigned id = kNobody);

}  // namespace fastcycle::test
