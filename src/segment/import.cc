#include "segment/import.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <mutex>
#include <new>

namespace fastcycle::segment {
namespace {

/// A larger gap in the sequences is no loss: its publisher, which need not be trusted, is wrong.
constexpr std::uint64_t kMaxLost = std::uint64_t{1} << 32U;

}  // namespace

/// The messages of one incarnation of the publisher that this process holds: owns an envelope for
/// each number, and returns released ones.
class Import::Held final : public detail::ReturnSink {
 public:
  Held(const Wire& wire, const LinkPlan& link, std::uint32_t its_publisher, std::uint32_t own)
      : publisher(its_publisher),
        returns_(wire.returns(link, own, its_publisher)),
        return_count_(Wire::return_count(link)),
        pool_(new detail::Pool(nullptr, wire.plan().roots)),
        words_(link.capacity) {
    pool_->send_back_to(*this);
    pool_->grow(link.capacity);
    for (std::uint32_t i = 0; i < link.capacity; ++i) {
      envelopes_.push_back(pool_->take());
    }
    // The pool's envelopes are contiguous.
    std::ranges::sort(envelopes_);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  ~Held() override {
    if (count() > 0) {
      return;  // Remaining holders may read them as long as the process lives.
    }
    for (detail::Envelope* envelope : envelopes_) {
      pool_->put_back(envelope);
    }
    pool_->close();
  }

  /// The envelope for message `number`; null if that is still held.
  detail::Envelope* begin(std::uint64_t word) noexcept {
    const std::uint64_t number = number_of(word);
    if (number >= envelopes_.size() || words_[number].load(std::memory_order_acquire) != 0) {
      return nullptr;
    }
    words_[number].store(word + 1, std::memory_order_relaxed);
    count_.fetch_add(1, std::memory_order_relaxed);
    return envelopes_[number];
  }

  void came_back(detail::Envelope& envelope) noexcept override {
    const auto number = static_cast<std::size_t>(&envelope - envelopes_.front());
    const std::uint64_t word = words_[number].exchange(0, std::memory_order_acq_rel);
    if (!is_old.load(std::memory_order_acquire)) {
      send_back(word - 1);
    }
    count_.fetch_sub(1, std::memory_order_release);
  }

  /// Returns the message of this word to the publisher.
  void send_back(std::uint64_t word) noexcept {
    const std::uint64_t place = next_return_.fetch_add(1, std::memory_order_relaxed);
    returns_[place % return_count_].store(word | lap_of_return(place, return_count_),
                                          std::memory_order_release);
  }

  [[nodiscard]] std::size_t count() const noexcept {
    return count_.load(std::memory_order_acquire);
  }

  const std::uint32_t publisher;
  /// The publisher has ended: its memory stays, and needs no returns.
  std::atomic<bool> is_old{false};

 private:
  std::atomic<std::uint64_t>* const returns_;
  const std::uint64_t return_count_;
  detail::Pool* const pool_;
  std::vector<detail::Envelope*> envelopes_;
  std::vector<std::atomic<std::uint64_t>> words_;  ///< By number: the word to return, + 1.
  std::atomic<std::uint64_t> next_return_{0};
  std::atomic<std::size_t> count_{0};
};

Import::Import(const Wire& wire, const LinkPlan& link, std::uint32_t incarnation,
               detail::PublisherCore& stand_in)
    : wire_(wire),
      link_(link),
      incarnation_(incarnation),
      stand_in_(stand_in),
      in_(wire.in(link, incarnation)),
      trails_(link.is_serialized ? wire.plan().roots : 0) {
  if (link.credits > 0) {
    stand_in.use_credits(link.credits);
    stand_in.credits()->relay_to(*this);
  }
}

Import::~Import() = default;

/// Updates the oldest incarnation whose messages are held.
void Import::report_oldest() {
  std::erase_if(held_, [this](const auto& held) {
    return held->publisher != publisher_ && held->count() == 0;
  });
  const std::uint32_t next = publisher_ != 0 ? publisher_ : newest_ + 1;
  in_.oldest.store(held_.empty() ? next : held_.front()->publisher, std::memory_order_release);
}

std::size_t Import::held() const noexcept {
  std::size_t count = 0;
  for (const auto& held : held_) {
    count += held->count();
  }
  return count;
}

void Import::attach() {
  const std::uint32_t now = wire_.incarnation(link_.from).load(std::memory_order_acquire);
  if (now == publisher_) {
    report_oldest();  // Requests for the memory of an old incarnation arrive as a ring.
    return;
  }
  while (publisher_ != 0 && take_in_order()) {
  }
  if (!held_.empty()) {
    held_.back()->is_old.store(true, std::memory_order_release);
  }
  newest_ = now != 0 ? now : publisher_;
  publisher_ = now;
  report_oldest();
  if (now == 0) {
    begin_credits(0);
    return;
  }
  in_.ready.store(0, std::memory_order_seq_cst);
  std::atomic<std::uint64_t>* const returns = wire_.returns(link_, incarnation_, now);
  for (std::uint32_t i = 0; i < Wire::return_count(link_); ++i) {
    returns[i].store(0, std::memory_order_relaxed);
  }
  const LinkOut& out = wire_.out(link_, now);
  const bool is_first = held_.empty() && stand_in_.published() == 0;
  held_.push_back(std::make_unique<Held>(wire_, link_, now, incarnation_));
  head_ = out.tail.load(std::memory_order_seq_cst);
  if (is_first) {
    // A publisher that was restarted as well has no sequence there before it publishes.
    const std::uint64_t before =
        now > 1 ? wire_.out(link_, now - 1).sequence.load(std::memory_order_relaxed) : 0;
    stand_in_.continue_after(std::max(out.sequence.load(std::memory_order_relaxed), before));
  }
  in_.taking.store(head_, std::memory_order_seq_cst);
  begin_credits(now);
  in_.ready.store(std::uint64_t{now} << 32 | incarnation_, std::memory_order_seq_cst);
}

/// The next credits are for `publisher`, from `head_` on.
void Import::begin_credits(std::uint32_t publisher) {
  if (link_.credits == 0) {
    return;
  }
  {
    const std::lock_guard lock(stand_in_.mutex());
    credited_ = publisher;
    passed_on_ = head_;
  }
  report_finished();
}

void Import::credit_returned() noexcept {
  if (!wire_.plan().is_simulated) {  // Else between rounds.
    report_finished();
  }
}

void Import::report_finished() noexcept {
  if (link_.credits == 0) {
    return;
  }
  const std::lock_guard lock(stand_in_.mutex());
  if (credited_ == 0) {
    return;
  }
  const detail::Credits& credits = *stand_in_.credits();
  const std::uint64_t unfinished = credits.window - credits.left(0);
  in_.finished.store(passed_on_ - unfinished, std::memory_order_seq_cst);
  if (wire_.out(link_, credited_).awaits_credit.load(std::memory_order_seq_cst) == 0) {
    return;
  }
  auto& bell = wire_.bell(link_.to, incarnation_, link_.from, link_.publisher_executor);
  bell.fetch_add(1, std::memory_order_seq_cst);
  if (wire_.sleepers(link_.from, credited_, link_.publisher_executor)
          .load(std::memory_order_seq_cst) != 0) {
    wake(bell, 1);
  }
}

/// The word at `head_`, or a later one if the publisher overtook it; false if there is none yet.
bool Import::find(std::uint64_t& word) noexcept {
  if (publisher_ == 0) {
    return false;
  }
  const LinkOut& out = wire_.out(link_, publisher_);
  const std::atomic<std::uint64_t>* const slots = wire_.slots(link_, publisher_);
  // A publisher that is not trusted may change its words all the time; it rings for what comes.
  constexpr int kTries = 8;
  for (int tries = 0; tries < kTries; ++tries) {
    const std::uint64_t tail = out.tail.load(std::memory_order_seq_cst);
    if (tail <= head_) {
      return false;
    }
    word = slots[head_ % Wire::slot_count(link_)].load(std::memory_order_seq_cst);
    if (position_of(word) == head_) {
      return true;
    }
    // Dropped, and about to be rewritten, with another ring. Or it was dropped long ago.
    const std::uint64_t later = out.tail.load(std::memory_order_seq_cst);
    if (later <= head_ + link_.depth) {
      return false;
    }
    head_ = later - link_.depth;
  }
  return false;
}

bool Import::has_any() noexcept {
  std::uint64_t word = 0;
  return find(word);
}

bool Import::take() noexcept {
  bool has_taken = false;
  for (std::uint32_t i = 0; i < link_.depth && take_in_order(); ++i) {
    has_taken = true;
  }
  if (has_taken && link_.credits > 0) {
    {
      const std::lock_guard lock(stand_in_.mutex());
      passed_on_ = head_;
    }
    credit_returned();  // Of messages that were skipped, or that no lane took.
  }
  return has_taken;
}

void Import::count_rest() noexcept {
  const std::uint32_t publisher = publisher_ != 0 ? publisher_ : newest_;
  // One of a pair may have published what the other one's sequence has.
  if (publisher == 0 || partner_ != nullptr || stand_in_.is_following()) {
    return;
  }
  const LinkOut& out = wire_.out(link_, publisher);
  const std::uint64_t last = out.sequence.load(std::memory_order_relaxed);
  // Those still there were published while all stops.
  const std::uint64_t there = out.tail.load(std::memory_order_seq_cst) - head_;
  const std::lock_guard lock(stand_in_.mutex());
  const std::uint64_t known = stand_in_.published() + there;
  if (last > known && last - known <= kMaxLost) {
    stand_in_.lose_imported(last - known);
  }
}

/// The sequence of the message of `word`.
std::uint64_t Import::sequence_of(std::uint64_t word) const noexcept {
  return number_of(word) < link_.capacity
             ? wire_.messages(link_, publisher_)[number_of(word)].info.sequence
             : 0;
}

/// As `take_one`; earlier messages of the other process of a pair come first. This link is checked
/// first: if a message arrives there later, the other one's check was complete.
bool Import::take_in_order() noexcept {
  if (partner_ != nullptr) [[unlikely]] {
    std::uint64_t own = 0;
    std::uint64_t other = 0;
    if (!find(own)) {
      return false;
    }
    if (partner_->find(other) && partner_->sequence_of(other) < sequence_of(own)) {
      return partner_->take_one();
    }
  }
  return take_one();
}

/// Takes one message, or skips one that is gone; false if there is nothing.
bool Import::take_one() noexcept {
  std::uint64_t word = 0;
  if (!find(word)) {
    return false;
  }
  const std::atomic<std::uint64_t>* const slots = wire_.slots(link_, publisher_);
  const std::uint32_t slot_count = Wire::slot_count(link_);
  in_.taking.store(head_ + 1, std::memory_order_seq_cst);  // Claims it.
  const bool is_ours = slots[head_ % slot_count].load(std::memory_order_seq_cst) == word;
  const std::uint64_t position = head_++;
  Held& held = *held_.back();
  if (number_of(word) >= link_.capacity) {
    return true;
  }
  if (!is_ours) {
    held.send_back(word);  // If the publisher took it back first, it refuses this.
    return true;
  }
  const WireMessage& message = wire_.messages(link_, publisher_)[number_of(word)];
  if (message.receiver.load(std::memory_order_acquire) != incarnation_ ||
      message.position.load(std::memory_order_relaxed) != position) {
    return true;  // Sent to the previous incarnation.
  }
  if (link_.is_serialized) {
    if (!take_copy(word)) {
      refused_.fetch_add(1, std::memory_order_relaxed);
    }
    return true;
  }
  const unsigned generation = Wire::generation_of(publisher_);
  if (!wire_.segments().is_in(link_.from, generation, message.payload,
                              sizeof(google::protobuf::Message))) {
    held.send_back(word);
    return true;
  }
  detail::Envelope* const envelope = held.begin(word);
  if (envelope == nullptr) {
    return true;  // The publisher reused a number that was not returned: a protocol violation.
  }
  envelope->info = message.info;
  envelope->payload = message.payload;
  for (std::size_t root = 0; root < wire_.plan().roots; ++root) {
    const auto number = static_cast<std::size_t>(number_of(word));
    envelope->trails[root] = wire_.trails(link_, publisher_)[number * wire_.plan().roots + root];
  }
  const std::lock_guard lock(stand_in_.mutex());
  stand_in_.publish_imported(envelope, partner_ != nullptr || stand_in_.is_following());
  return true;
}

/// Takes the message of `word` from a publisher that is not trusted; false if it is invalid. Each
/// of its words is read once, and checked where it is copied to.
bool Import::take_copy(std::uint64_t word) noexcept {
  const std::uint64_t number = number_of(word);
  const WireMessage& message = wire_.messages(link_, publisher_)[number];
  const char* const bytes = message.bytes.load(std::memory_order_relaxed);
  const std::uint64_t count = message.byte_count.load(std::memory_order_relaxed);
  const unsigned generation = Wire::generation_of(publisher_);
  bool is_valid = count <= std::uint64_t{std::numeric_limits<int>::max()} &&
                  wire_.segments().is_in(link_.from, generation, bytes, count);
  try {
    if (is_valid) {
      bytes_.assign(bytes, count);
    }
  } catch (const std::bad_alloc&) {
    is_valid = false;
  }
  for (std::size_t root = 0; root < trails_.size(); ++root) {
    trails_[root] = detail::Trail::read_untrusted(
        wire_.trails(link_, publisher_)[number * trails_.size() + root]);
  }
  const MessageInfo info = message.info;
  held_.back()->send_back(word);  // Also of an invalid one: it is not used any more.
  try {
    return is_valid && publish_copy(info);
  } catch (const std::exception&) {  // No memory for it, or the receivers hold too many.
    return false;
  }
}

/// Publishes the message of `bytes_`; false if it is none of the topic's type.
bool Import::publish_copy(MessageInfo info) {
  const std::lock_guard lock(stand_in_.mutex());
  if (info.sequence > stand_in_.published() + kMaxLost) {
    return false;
  }
  if (const base::Clock& clock = *stand_in_.owner.clock; !clock.is_simulated()) {
    const Time now = clock.now();
    info.publish_time = std::min(info.publish_time, now);
    info.origin.taken = std::min(info.origin.taken, now);
  }
  detail::Envelope* const loan = stand_in_.loan(false);
  if (!loan->own->ParsePartialFromString(bytes_)) {
    stand_in_.return_loan(loan);
    return false;
  }
  stand_in_.publish_copied(loan, info, trails_);
  return true;
}

}  // namespace fastcycle::segment
