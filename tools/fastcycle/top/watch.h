#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "inspect/client.h"
#include "top/model.h"

namespace fastcycle::tool::top {

/// Queries the state of a running application.
///
/// @errors  As `inspect::Client`.
[[nodiscard]] Snapshot snapshot_of(inspect::Client& client);

/// Queries the state of a running application periodically, on its own thread, so that slow answers
/// do not delay the keys.
///
/// @threads  Confined to its owner.
class Watch {
 public:
  using Clock = std::chrono::steady_clock;

  Watch(std::unique_ptr<inspect::Client> client, std::chrono::milliseconds interval);
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;
  ~Watch();

  /// Readable when there is news.
  [[nodiscard]] int descriptor() const { return news_; }

  struct News {
    std::optional<Snapshot> snapshot = {};  ///< The newest, if there is one.
    std::optional<std::string> end =
        {};  ///< Why there will be no more; empty: no more application.
  };
  /// The news since the last call.
  [[nodiscard]] News take();

  /// When the last answer arrived.
  [[nodiscard]] Clock::time_point last_update() const;

 private:
  void run();
  void post(News news);

  const std::unique_ptr<inspect::Client> client_;
  const std::chrono::milliseconds interval_;
  int news_ = -1;  ///< An eventfd.

  mutable std::mutex mutex_;  ///< Guards all below.
  std::condition_variable changed_;
  bool is_over_ = false;
  News untaken_;
  Clock::time_point last_update_ = Clock::now();

  std::thread thread_;
};

}  // namespace fastcycle::tool::top
