#pragma once

#include <cstdint>
#include <optional>

#include "broker/quality.h"

namespace fastcycle::detail {

class PublisherCore;

/// The deadline that a publisher offers: its own component is notified of violations.
class OfferedDeadline final : public Watch {
 public:
  OfferedDeadline(PublisherCore& its_publisher, Duration period);

  void begin(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::optional<QosEvent> look(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t next_look_ns() const noexcept override;

  [[nodiscard]] Duration period() const noexcept { return *deadline_.period(); }
  void set_period(Duration period) noexcept { deadline_.set_period(period); }

  PublisherCore& publisher;
  Counter missed;

 private:
  Deadline deadline_;
  std::int64_t begin_ns_ = 0;
};

}  // namespace fastcycle::detail
