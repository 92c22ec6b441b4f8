#include "config/machine.h"

#include <cerrno>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <pwd.h>
#include <unistd.h>

#include "config/merge.h"

namespace fastcycle::config {

namespace {

void warn(const Value& at, std::string message, Problems& problems) {
  Problem problem = make_error(at.place(), std::move(message));
  problem.warning = true;
  problems.add(std::move(problem));
}

/// Whether the machine has no such user for sure; one whose lookup fails may be there.
bool is_unknown_user(const std::string& name) {
  constexpr std::size_t kMaxBuffer = std::size_t{1} << 20U;
  std::vector<char> buffer(1024);
  for (;;) {
    passwd entry{};
    passwd* found = nullptr;
    const int error = getpwnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found);
    if (error == ERANGE && buffer.size() < kMaxBuffer) {
      buffer.resize(buffer.size() * 2);
      continue;
    }
    return found == nullptr && (error == 0 || error == ENOENT || error == ESRCH);
  }
}

void check_user(const Value& process, Problems& problems) {
  const Value* user = find_string(process, "user");
  if (user != nullptr && !user->as_string().empty() && is_unknown_user(user->as_string())) {
    problems.add(unexpected(*user, "a user of this machine"));
  }
}

void check_cpus(const Value& process, Problems& problems) {
  const long count = sysconf(_SC_NPROCESSORS_CONF);
  const Value* cpus = find_array(process, "cpus");
  if (cpus == nullptr || count <= 0) {
    return;
  }
  for (const Value& cpu : cpus->items()) {
    if (cpu.type() == Value::Type::kInt && cpu.as_int64() >= count) {
      warn(cpu,
           "this machine has no CPU " + std::to_string(cpu.as_int64()) + ", only " +
               (count == 1 ? "CPU 0" : "CPUs 0 to " + std::to_string(count - 1)),
           problems);
    }
  }
}

void check_sandbox(const Value& process, Problems& problems) {
  const Value* sandbox = find_object(process, "sandbox");
  if (sandbox == nullptr) {
    return;
  }
  for (const char* key : {"read", "write"}) {
    const Value* paths = find_array(*sandbox, key);
    if (paths == nullptr) {
      continue;
    }
    for (const Value& path : paths->items()) {
      std::error_code ignored;
      if (path.is_string() && std::filesystem::status(path.as_path(), ignored).type() ==
                                  std::filesystem::file_type::not_found) {
        warn(path, "there is no file or folder " + shown(path), problems);
      }
    }
  }
}

}  // namespace

void check_machine(const Value& tree, Problems& problems) {
  if (const Value* processes = find_array(tree, "processes")) {
    for (const Value& process : processes->items()) {
      check_user(process, problems);
      check_cpus(process, problems);
      check_sandbox(process, problems);
    }
  }
}

}  // namespace fastcycle::config
