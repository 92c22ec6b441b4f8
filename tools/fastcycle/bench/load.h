#pragma once

#include <cstdint>
#include <vector>

#include <sys/types.h>

namespace fastcycle::tool::bench {

/// Processes that do nothing but use a CPU each, as long as this lives. They are no threads, so
/// that what they use is not counted as the benchmark's.
///
/// @pre  The process has one thread when this is made.
class Load {
 public:
  explicit Load(std::int64_t count);
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;
  ~Load();

 private:
  std::vector<pid_t> processes_;
};

}  // namespace fastcycle::tool::bench
