#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/shared_memory.h"
#include "broker/message_export.h"
#include "segment/layout.h"
#include "segment/wire.h"

namespace fastcycle::segment {

/// Statistics of one link at the publisher's end.
struct ExportCounts {
  std::uint64_t given = 0;       ///< Handed over.
  std::uint64_t copied = 0;      ///< Had to be copied into the segment.
  std::uint64_t repaired = 0;    ///< Had strings outside of the segment, which were moved.
  std::uint64_t unshared = 0;    ///< Did not fit into the segment: not sent to other processes.
  std::uint64_t overflowed = 0;  ///< Dropped: the queue was full.
  std::uint64_t over_quota = 0;  ///< Dropped: the receiver holds its maximum.
  std::uint64_t refused = 0;     ///< Invalid returns, of messages that the receiver did not hold.
  std::uint64_t taken_back = 0;  ///< Held by a receiver that ended.
};

/// The publisher's end of a link: owns the table of messages held by the receiver, which alone
/// decides which returns are valid. The receiver can only return messages.
///
/// Over a serialized link it sends the message's bytes, and keeps no reference to the message.
///
/// @threads  As the publisher; `counts`, `unfinished` and `set_awaited` are Safe.
/// @realtime No allocation, no lock; one system call if the receiver sleeps.
class Export final : public detail::MessageExport {
 public:
  /// `incarnation` is that of this process. All arguments must outlive this.
  Export(const Wire& wire, const LinkPlan& link, std::uint32_t incarnation,
         const google::protobuf::Message& default_instance);

  void put(detail::Envelope& envelope) noexcept override;
  void collect() noexcept override;
  [[nodiscard]] google::protobuf::Message* share(
      google::protobuf::Message* message) noexcept override;
  [[nodiscard]] std::size_t capacity() const noexcept override { return link_.capacity; }
  [[nodiscard]] bool returns_credits() const noexcept override { return link_.credits > 0; }
  [[nodiscard]] std::uint64_t unfinished() const noexcept override;
  void set_awaited(bool is_awaited) noexcept override {
    out_.awaits_credit.store(is_awaited ? 1 : 0, std::memory_order_seq_cst);
  }
  /// In simulated time: what was finished in the last round counts from now on. Between rounds.
  void take_finished() noexcept { finished_.store(read_finished(), std::memory_order_relaxed); }

  /// Whether a receiver is connected.
  [[nodiscard]] bool is_connected() noexcept;
  /// The same, and nothing was sent yet to this incarnation.
  [[nodiscard]] bool is_fresh() noexcept { return is_connected() && given_to_receiver_ == 0; }
  [[nodiscard]] ExportCounts counts() const noexcept;
  /// Why every message is copied; null if only some are, or none.
  [[nodiscard]] const char* always_copied() const noexcept {
    return link_.is_serialized ? "its process is not trusted" : layout_.always_copied();
  }
  [[nodiscard]] const LinkPlan& link() const noexcept { return link_; }

 private:
  struct Held {
    detail::Envelope* envelope = nullptr;  ///< Null over a serialized link.
    std::uint64_t given = 0;               ///< Its position + 1; 0: it is free.
    std::uint64_t bytes = 0;
  };
  /// Memory in the segment that is reused, for the bytes of a message.
  struct Buffer {
    struct Free {
      void operator()(char* memory) const noexcept { base::shared_memory.allocator->free(memory); }
    };
    std::unique_ptr<char, Free> bytes;
    std::size_t capacity = 0;
  };
  /// One writer, many readers.
  using Count = std::atomic<std::uint64_t>;
  static void add(Count& count, std::uint64_t amount = 1) noexcept {
    count.store(count.load(std::memory_order_relaxed) + amount, std::memory_order_relaxed);
  }

  [[nodiscard]] bool is_reading(std::uint32_t receiver) const noexcept;
  [[nodiscard]] std::uint64_t read_finished() const noexcept;
  void forget_receiver(std::uint32_t incarnation) noexcept;
  bool take_back(std::uint64_t word) noexcept;
  bool make_room(std::uint64_t tail) noexcept;
  bool serialize(const google::protobuf::Message& payload, std::uint16_t number) noexcept;

  const Wire& wire_;
  const LinkPlan& link_;
  const Layout& layout_;
  LinkOut& out_;
  std::atomic<std::uint64_t>* const slots_;
  WireMessage* const messages_;
  detail::Trail* const trails_;
  std::atomic<std::uint32_t>& bell_;
  const std::uint32_t own_incarnation_;

  std::vector<Held> held_;
  std::vector<std::uint16_t> free_;
  std::vector<Buffer> buffers_;  ///< Of a serialized link, by number.
  std::uint32_t receiver_ = 0;   ///< Its incarnation, as last seen.
  std::uint64_t returns_read_ = 0;
  std::uint64_t given_to_receiver_ = 0;
  std::uint64_t bytes_out_ = 0;             ///< Total size of `held_`.
  std::atomic<std::uint64_t> finished_{0};  ///< In simulated time.

  Count given_{0};
  Count copied_{0};
  Count repaired_{0};
  Count unshared_{0};
  Count overflowed_{0};
  Count over_quota_{0};
  Count refused_{0};
  Count taken_back_{0};
};

}  // namespace fastcycle::segment
