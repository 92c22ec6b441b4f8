#include "process.h"

#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <fcntl.h>
#include <grp.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::test {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

constexpr int kLookMs = 10;  ///< How often it is looked whether a process has ended.

std::vector<char*> pointers_to(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) {
    pointers.push_back(word.data());
  }
  pointers.push_back(nullptr);
  return pointers;
}

void append(pollfd& stream, std::string& text) {
  char buffer[4096];
  const ssize_t count = ::read(stream.fd, buffer, sizeof(buffer));
  if (count > 0) {
    text.append(buffer, static_cast<std::size_t>(count));
  } else if (count == 0 || (errno != EINTR && errno != EAGAIN)) {
    close(stream.fd);
    stream.fd = -1;
  }
}

}  // namespace

Process::Process(const ProcessOptions& options) : limit_(steady_clock::now() + kLongest) {
  int output[2];
  int errors[2];
  if (pipe2(output, O_CLOEXEC) != 0 || pipe2(errors, O_CLOEXEC) != 0) {
    throw std::runtime_error("no pipe could be made");
  }
  pid_ = fork();
  if (pid_ < 0) {
    throw std::runtime_error("no process could be made");
  }
  if (pid_ == 0) {
    start(options, output[1], errors[1]);
  }
  close(output[1]);
  close(errors[1]);
  streams_[0] = {output[0], POLLIN, 0};
  streams_[1] = {errors[0], POLLIN, 0};
  for (const pollfd& stream : streams_) {
    fcntl(stream.fd, F_SETFL, O_NONBLOCK);
  }
}

Process::~Process() {
  if (!has_ended_) {
    send(SIGKILL);
    wait();
  }
  for (const pollfd& stream : streams_) {
    if (stream.fd >= 0) {
      close(stream.fd);
    }
  }
}

void Process::start(const ProcessOptions& options, int output, int errors) const {
  setsid();
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::vector<std::string> words{options.program.string()};
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    variables.emplace_back(*variable);
  }
  // Of two with one name the first counts.
  variables.insert(variables.begin(), options.environment.begin(), options.environment.end());
  if (options.may_dump_core) {
    rlimit limit{};
    getrlimit(RLIMIT_CORE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_CORE, &limit);
  }
  const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
  const bool is_ready = (!options.is_ordinary_user || become_ordinary_user()) &&
                        dup2(nothing, STDIN_FILENO) >= 0 && dup2(output, STDOUT_FILENO) >= 0 &&
                        dup2(errors, STDERR_FILENO) >= 0 &&
                        (options.folder.empty() || chdir(options.folder.c_str()) == 0) &&
                        (!options.is_traced || ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) == 0);
  if (options.has_no_streams) {
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
      close(stream);
    }
  }
  if (is_ready) {
    execve(options.program.c_str(), pointers_to(words).data(), pointers_to(variables).data());
  }
  _exit(127);
}

void Process::send(int signal) const {
  if (!has_ended_) {
    kill(pid_, signal);
  }
}

void Process::read_once(int timeout_ms) {
  if (poll(streams_, 2, timeout_ms) <= 0) {
    return;
  }
  if (streams_[0].revents != 0) {
    append(streams_[0], output_);
  }
  if (streams_[1].revents != 0) {
    append(streams_[1], errors_);
  }
}

bool Process::try_reap() {
  int status = 0;
  if (has_ended_ || waitpid(pid_, &status, WNOHANG) != pid_) {
    return has_ended_;
  }
  if (WIFSTOPPED(status)) {
    // Only a traced program stops here: after its start, and for each signal, which it gets.
    const int signal = WSTOPSIG(status) == SIGTRAP ? 0 : WSTOPSIG(status);
    ptrace(PTRACE_CONT, pid_, nullptr, static_cast<long>(signal));
    return false;
  }
  has_ended_ = true;
  ending_.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  ending_.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  ending_.has_dumped = WIFSIGNALED(status) && WCOREDUMP(status);
  return true;
}

bool Process::wait_for(const std::string& text) {
  const auto has_come = [&] {
    return output_.find(text) != std::string::npos || errors_.find(text) != std::string::npos;
  };
  while (!has_come() && steady_clock::now() < limit_ && !try_reap()) {
    read_once(kLookMs);
  }
  return has_come();
}

const Ending& Process::wait() {
  while (!try_reap()) {
    read_once(kLookMs);
    if (steady_clock::now() > limit_ && !ending_.was_too_late) {
      ending_.was_too_late = true;
      kill(pid_, SIGKILL);
    }
  }
  // Whatever it wrote is in the pipes now, which hold 64 KiB each.
  constexpr int kReadsToEmptyAPipe = 64;
  for (int i = 0; i < kReadsToEmptyAPipe; ++i) {
    read_once(0);
  }
  return ending_;
}

Folder::Folder() {
  std::string name = (fs::temp_directory_path() / "fastcycle-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    throw std::runtime_error("no temporary folder");
  }
  path_ = name;
  chmod(path_.c_str(), 01777);
}

Folder::~Folder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

fs::path Folder::write(const std::string& name, const std::string& content) const {
  const fs::path file = path_ / name;
  std::ofstream(file, std::ios::binary) << content;
  return file;
}

std::string read_file(const fs::path& file) {
  // What ends while it is read, as files of /proc do, is what was read until then.
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

namespace {

/// Calls `take` with the pid and name of each.
template <typename Take>
void look_at_session(pid_t leader, const Take& take) {
  for (const auto& entry : fs::directory_iterator("/proc")) {
    if (std::isdigit(static_cast<unsigned char>(entry.path().filename().string().front())) == 0) {
      continue;
    }
    std::string status = read_file(entry.path() / "stat");
    const std::size_t begin = status.find('(');
    const std::size_t end = status.rfind(')');
    if (begin == std::string::npos || end == std::string::npos) {
      continue;
    }
    const std::string name = status.substr(begin + 1, end - begin - 1);
    status.erase(0, end + 1);
    std::istringstream words(status);
    std::string state;
    pid_t parent = 0;
    pid_t group = 0;
    pid_t session = 0;
    words >> state >> parent >> group >> session;
    if (session == leader && state != "Z") {
      take(static_cast<pid_t>(std::stoi(entry.path().filename().string())), name);
    }
  }
}

}  // namespace

int processes_of_session(pid_t leader) {
  int count = 0;
  look_at_session(leader, [&](pid_t, const std::string&) { ++count; });
  return count;
}

pid_t process_of_session(pid_t leader, const std::string& name) {
  pid_t found = 0;
  look_at_session(leader, [&](pid_t process, const std::string& its_name) {
    found = its_name == name ? process : found;
  });
  return found;
}

bool become_ordinary_user(unsigned id) {
  if (geteuid() == 0) {
    if (setgroups(0, nullptr) != 0 || setresgid(id, id, id) != 0 || setresuid(id, id, id) != 0) {
      return false;
    }
  }
  // Changed ids clear it.
  return prctl(PR_SET_PDEATHSIG, SIGKILL) == 0;
}

std::string as_ordinary_user(const std::function<std::string()>& body, unsigned id) {
  int result[2];
  if (pipe2(result, O_CLOEXEC) != 0) {
    throw std::runtime_error("no pipe could be made");
  }
  const pid_t pid = fork();
  if (pid < 0) {
    throw std::runtime_error("no process could be made");
  }
  if (pid == 0) {
    close(result[0]);
    std::string text = "it was not possible to become an ordinary user";
    try {
      if (become_ordinary_user(id)) {
        text = body();
      }
    } catch (const std::exception& error) {
      text = error.what();
    }
    for (std::string_view rest = text; !rest.empty();) {
      const ssize_t count = write(result[1], rest.data(), rest.size());
      if (count <= 0) {
        break;
      }
      rest.remove_prefix(static_cast<std::size_t>(count));
    }
    _exit(0);
  }
  close(result[1]);
  std::string text;
  char buffer[4096];
  for (;;) {
    const ssize_t count = ::read(result[0], buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count <= 0) {
      break;
    }
    text.append(buffer, static_cast<std::size_t>(count));
  }
  close(result[0]);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return text;
}

}  // namespace fastcycle::test
