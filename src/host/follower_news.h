#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "component/peers.h"

namespace fastcycle::host {

/// The last report of each standby process: a JSON object that the main process keeps for tools and
/// does not parse.
///
/// @threads  Safe.
class FollowerNews {
 public:
  void take(const Notice& notice) {
    const std::lock_guard lock(mutex_);
    if (notice.kind == Notice::Kind::kFollows) {
      by_process_[notice.process] = notice.text;
    } else if (notice.kind == Notice::Kind::kGone) {
      by_process_.erase(notice.process);
    }
  }

  /// By process.
  [[nodiscard]] std::vector<std::string> all() const {
    std::vector<std::string> all;
    const std::lock_guard lock(mutex_);
    for (const auto& [process, text] : by_process_) {
      all.push_back(text);
    }
    return all;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::uint32_t, std::string> by_process_;
};

}  // namespace fastcycle::host
