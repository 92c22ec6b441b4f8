#include "exposure.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <vector>

#include <sys/stat.h>

#include "process/process.h"

namespace fastcycle::test {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  return {std::istream_iterator<std::string>(stream), {}};
}

/// The numbers of the sockets that `pid` has open.
std::set<std::string> socket_numbers_of(pid_t pid) {
  constexpr std::string_view kMark = "socket:[";
  std::set<std::string> numbers;
  for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(pid) + "/fd")) {
    std::error_code gone;
    const std::string target = fs::read_symlink(entry.path(), gone).string();
    if (target.starts_with(kMark)) {
      numbers.insert(target.substr(kMark.size(), target.size() - kMark.size() - 1));
    }
  }
  return numbers;
}

}  // namespace

std::set<std::string> sockets_of(pid_t pid) {
  // The column of a table that holds the number of the socket.
  struct Table {
    const char* name;
    std::size_t column;
  };
  constexpr Table kTables[] = {{"tcp", 9}, {"tcp6", 9}, {"udp", 9},  {"udp6", 9},
                               {"raw", 9}, {"raw6", 9}, {"unix", 6}, {"packet", 8}};
  std::set<std::string> sockets;
  std::set<std::string> numbers = socket_numbers_of(pid);
  for (const Table& table : kTables) {
    std::ifstream stream("/proc/" + std::to_string(pid) + "/net/" + table.name);
    for (std::string line; std::getline(stream, line);) {
      const std::vector<std::string> words = words_of(line);
      if (words.size() > table.column && numbers.erase(words[table.column]) > 0) {
        sockets.insert(std::string(table.name) + ": " + line);
      }
    }
  }
  for (const std::string& number : numbers) {
    sockets.insert("of no known kind: " + number);
  }
  return sockets;
}

std::set<std::string> shared_memory_of(uid_t uid) {
  std::set<std::string> found;
  for (const char* folder : {"/dev/shm", "/dev/mqueue"}) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      struct stat status{};
      if (lstat(entry->path().c_str(), &status) == 0 && status.st_uid == uid) {
        found.insert(entry->path().string());
      }
    }
  }
  // The owner is in column 7 of the table of segments, in 4 and 7 of the others.
  struct Table {
    const char* name;
    std::size_t column;
  };
  for (const Table& table : {Table{"shm", 7}, Table{"sem", 4}, Table{"msg", 7}}) {
    std::ifstream stream(std::string("/proc/sysvipc/") + table.name);
    for (std::string line; std::getline(stream, line);) {
      const std::vector<std::string> words = words_of(line);
      if (words.size() > table.column && words[table.column] == std::to_string(uid)) {
        found.insert(std::string("System V ") + table.name + " " + words[1]);
      }
    }
  }
  return found;
}

std::set<std::string> shared_mappings_of(pid_t pid) {
  std::set<std::string> found;
  std::istringstream maps(read_file("/proc/" + std::to_string(pid) + "/maps"));
  for (std::string line; std::getline(maps, line);) {
    if (line.find("/dev/shm/") != std::string::npos || line.find("/SYSV") != std::string::npos) {
      found.insert(line);
    }
  }
  return found;
}

}  // namespace fastcycle::test
