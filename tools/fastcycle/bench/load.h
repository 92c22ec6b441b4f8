#pragma once

#include <cstdint>
#include <vector>

#include <sys/types.h>

namespace fastcycle::tool::bench {

/// Processes that each keep one CPU busy during the lifetime of this object. They are not threads,
/// so that their CPU time is not counted as the benchmark's.
///
/// @pre  The process has one thread when this is constructed.
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
