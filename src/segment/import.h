#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "broker/message_export.h"
#include "broker/pool.h"
#include "broker/publisher_core.h"
#include "segment/wire.h"

namespace fastcycle::segment {

/// The receiver's end of a link: hands what comes to the lanes of its process, in the name of the
/// publisher, and tells the publisher what is not held any more.
///
/// @threads  `take` and `has_any` by one thread at a time; `came_back` is Safe.
/// @realtime After the first messages of a publisher no allocation; the lock of its stand-in.
class Import final {
 public:
  /// `stand_in` is what the process knows of the publisher: an external one, to which nobody else
  /// gives anything. `incarnation` is that of this process. All have to live as long as this.
  Import(const Wire& wire, const LinkPlan& link, std::uint32_t incarnation,
         detail::PublisherCore& stand_in);
  Import(const Import&) = delete;
  Import& operator=(const Import&) = delete;
  ~Import();

  /// Reads from the publisher as it is now; what its last incarnation left is taken first. Where
  /// there is none, it is looked for again.
  void attach();
  /// Hands on what came, at most what the queue may hold; true if there was anything.
  bool take() noexcept;
  [[nodiscard]] bool has_any() noexcept;

  /// `other` comes from the other one of two processes that take each other's place: of both
  /// messages come in the order of their sequences.
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

 private:
  class Held;

  void say_oldest();
  bool find(std::uint64_t& word) noexcept;
  bool take_one() noexcept;
  bool take_in_order() noexcept;
  [[nodiscard]] std::uint64_t sequence_of(std::uint64_t word) const noexcept;

  const Wire& wire_;
  const LinkPlan& link_;
  const std::uint32_t incarnation_;
  detail::PublisherCore& stand_in_;
  LinkIn& in_;
  Import* partner_ = nullptr;

  std::uint32_t publisher_ = 0;  ///< Its incarnation that is read; 0: none.
  std::uint32_t newest_ = 0;     ///< The last that there was.
  std::uint64_t head_ = 0;
  std::vector<std::unique_ptr<Held>> held_;  ///< By incarnation of the publisher, the last is now.
};

}  // namespace fastcycle::segment
