#pragma once

#include "base/log.h"
#include "broker/topics.h"

namespace fastcycle::host {

/// Logs which component holds so many messages of a pool that it runs short, and the remedy.
///
/// @threads  Safe.
/// @realtime As `LogSource::write`.
class PoolReporter final : public detail::PoolWatch {
 public:
  /// `log` outlives this.
  explicit PoolReporter(detail::LogSource& log) : log_(log) {}

  void ran_short(const detail::PoolShortage& shortage) noexcept override;

 private:
  detail::LogSource& log_;
};

}  // namespace fastcycle::host
