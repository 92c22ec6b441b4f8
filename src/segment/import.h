#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "broker/credits.h"
#include "broker/message_export.h"
#include "broker/pool.h"
#include "broker/publisher_core.h"
#include "broker/trail.h"
#include "segment/wire.h"

namespace fastcycle::segment {

/// The receiver's end of a link: passes incoming messages to the lanes of its process, in the name
/// of the publisher, and returns released messages to it.
///
/// Over a serialized link it copies the bytes before it looks at them, and parses the copy:
/// whatever the publisher writes, and whenever, the receivers get a valid message of their own or
/// none.
///
/// @threads  `take` and `has_any` by one thread at a time; `came_back`, `credit_returned` and
///           `report_finished` are Safe.
/// @realtime No allocation after the first messages of a publisher; takes the lock of its stand-in.
class Import final : public detail::CreditRelay {
 public:
  /// `stand_in` represents the publisher in this process: an external one, used only by this.
  /// `incarnation` is that of this process. All arguments must outlive this.
  Import(const Wire& wire, const LinkPlan& link, std::uint32_t incarnation,
         detail::PublisherCore& stand_in);
  ~Import() override;

  /// Connects to the present incarnation of the publisher, after taking what its last one left. If
  /// there is none, a later call connects.
  void attach();
  /// Takes pending messages, at most `depth`; true if there were any.
  bool take() noexcept;
  [[nodiscard]] bool has_any() noexcept;
  /// When nothing more is taken: counts the messages that were lost after the last one taken, which
  /// no later one shows.
  void count_rest() noexcept;

  void credit_returned() noexcept override;
  /// Reports to the publisher how many messages all receivers here have finished. Safe.
  void report_finished() noexcept;

  /// `other` leads from the other process of a standby pair: messages of both are taken in the
  /// order of their sequences.
  void pair_with(Import& other) noexcept {
    partner_ = &other;
    other.partner_ = this;
  }
  [[nodiscard]] bool stands_for(const detail::PublisherCore& publisher) const noexcept {
    return &stand_in_ == &publisher;
  }

  [[nodiscard]] const LinkPlan& link() const noexcept { return link_; }
  /// Messages that this process holds.
  [[nodiscard]] std::size_t held() const noexcept;
  /// Messages of a serialized link that were invalid, and dropped. Safe.
  [[nodiscard]] std::uint64_t refused() const noexcept {
    return refused_.load(std::memory_order_relaxed);
  }

 private:
  class Held;

  void report_oldest();
  void begin_credits(std::uint32_t publisher);
  bool find(std::uint64_t& word) noexcept;
  bool take_one() noexcept;
  bool take_copy(std::uint64_t word) noexcept;
  bool publish_copy(MessageInfo info);
  bool take_in_order() noexcept;
  [[nodiscard]] std::uint64_t sequence_of(std::uint64_t word) const noexcept;

  const Wire& wire_;
  const LinkPlan& link_;
  const std::uint32_t incarnation_;
  detail::PublisherCore& stand_in_;
  LinkIn& in_;
  Import* partner_ = nullptr;

  std::uint32_t publisher_ = 0;  ///< Incarnation being read; 0: none.
  std::uint32_t newest_ = 0;     ///< The last one that existed.
  std::uint64_t head_ = 0;
  std::atomic<std::uint64_t> refused_{0};
  // With credits; under the lock of the stand-in.
  std::uint32_t credited_ = 0;               ///< Incarnation of the publisher that gets them.
  std::uint64_t passed_on_ = 0;              ///< Position up to which messages are in the lanes.
  std::string bytes_;                        ///< Of a serialized link: the message being taken,
  std::vector<detail::Trail> trails_;        ///< and its trails.
  std::vector<std::unique_ptr<Held>> held_;  ///< By incarnation of the publisher; last: current.
};

}  // namespace fastcycle::segment
