#include "segment/export.h"

#include <algorithm>
#include <utility>

#include "base/shared_memory.h"

namespace fastcycle::segment {

Export::Export(const Wire& wire, const LinkPlan& link, std::uint32_t incarnation,
               const google::protobuf::Message& default_instance)
    : wire_(wire),
      link_(link),
      layout_(Layout::of(default_instance)),
      out_(wire.out(link, incarnation)),
      slots_(wire.slots(link, incarnation)),
      messages_(wire.messages(link, incarnation)),
      trails_(wire.trails(link, incarnation)),
      bell_(wire.bell(link.from, incarnation, link.to, link.executor)),
      own_incarnation_(incarnation),
      held_(link.capacity),
      buffers_(link.is_serialized ? link.capacity : 0) {
  free_.reserve(link.capacity);
  for (std::uint32_t number = link.capacity; number > 0; --number) {
    free_.push_back(static_cast<std::uint16_t>(number - 1));
  }
}

ExportCounts Export::counts() const noexcept {
  const auto get = [](const Count& count) { return count.load(std::memory_order_relaxed); };
  return {.given = get(given_),
          .copied = get(copied_),
          .repaired = get(repaired_),
          .unshared = get(unshared_),
          .overflowed = get(overflowed_),
          .over_quota = get(over_quota_),
          .refused = get(refused_),
          .taken_back = get(taken_back_)};
}

google::protobuf::Message* Export::share(google::protobuf::Message* message) noexcept {
  if (link_.is_serialized) {
    static_cast<void>(message->ByteSizeLong());  // Caches the sizes, for `put`.
    return message;
  }
  const Layout::Verdict verdict = layout_.check(*message);
  if (verdict == Layout::Verdict::kRepaired) {
    add(repaired_);
  } else if (verdict == Layout::Verdict::kOutside) {
    add(copied_);
    google::protobuf::Message* const copy = message->New();
    copy->CopyFrom(*message);
    delete std::exchange(message, copy);
  }
  // Caches the sizes, so that a reader in another process need not write them.
  static_cast<void>(message->ByteSizeLong());
  return message;
}

bool Export::is_connected() noexcept {
  const std::uint32_t now = wire_.incarnation(link_.to).load(std::memory_order_acquire);
  if (now != receiver_) {
    forget_receiver(now);
  }
  return is_reading(now);
}

bool Export::is_reading(std::uint32_t receiver) const noexcept {
  const std::uint64_t both = std::uint64_t{own_incarnation_} << 32 | receiver;
  return receiver != 0 && wire_.in(link_, receiver).ready.load(std::memory_order_acquire) == both;
}

/// Position up to which all receivers have finished: all, if nobody is connected.
std::uint64_t Export::read_finished() const noexcept {
  const std::uint32_t now = wire_.incarnation(link_.to).load(std::memory_order_acquire);
  return is_reading(now) ? wire_.in(link_, now).finished.load(std::memory_order_seq_cst)
                         : out_.tail.load(std::memory_order_relaxed);
}

std::uint64_t Export::unfinished() const noexcept {
  const std::uint64_t finished =
      wire_.plan().is_simulated ? finished_.load(std::memory_order_relaxed) : read_finished();
  // A receiver may write any word: with a wrong one, its own queue overflows.
  const std::uint64_t count = out_.tail.load(std::memory_order_relaxed) - finished;
  return count > std::uint64_t{1} << 63U ? 0 : count;
}

/// Takes back all that it held, or was sent.
void Export::forget_receiver(std::uint32_t incarnation) noexcept {
  for (std::size_t number = 0; number < held_.size(); ++number) {
    if (held_[number].given != 0) {
      take_back(to_word(held_[number].given - 1, number));
      add(taken_back_);
    }
  }
  receiver_ = incarnation;
  returns_read_ = 0;
  given_to_receiver_ = 0;
}

/// Accepts a return only if the table has the message as held.
bool Export::take_back(std::uint64_t word) noexcept {
  const std::uint64_t number = number_of(word);
  if (number >= held_.size() || held_[number].given != position_of(word) + 1) {
    return false;
  }
  held_[number].given = 0;
  bytes_out_ -= held_[number].bytes;
  free_.push_back(static_cast<std::uint16_t>(number));
  if (detail::Envelope* const envelope = std::exchange(held_[number].envelope, nullptr)) {
    detail::release(envelope);
  }
  return true;
}

void Export::collect() noexcept {
  if (!is_connected()) {
    return;
  }
  const std::atomic<std::uint64_t>* const returns =
      wire_.returns(link_, receiver_, own_incarnation_);
  const std::uint64_t count = Wire::return_count(link_);
  // At most one lap: a receiver that keeps writing must not block its publisher.
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t word = returns[returns_read_ % count].load(std::memory_order_acquire);
    if ((word & kLapBit) != lap_of_return(returns_read_, count)) {
      return;
    }
    ++returns_read_;
    if (!take_back(word & ~kLapBit)) {
      add(refused_);
    }
  }
}

/// Makes room for one more; false if there is none, and the new one is to be dropped.
bool Export::make_room(std::uint64_t tail) noexcept {
  const LinkIn& in = wire_.in(link_, receiver_);
  const std::uint64_t taking = in.taking.load(std::memory_order_seq_cst);
  if (taking > tail) {
    return true;
  }
  if (tail - taking < link_.depth) {
    return tail - taking < link_.depth_of_large || bytes_out_ < kBytesOut;
  }
  if (link_.drops_newest) {
    return false;
  }
  // The oldest one waiting: close it first, so that the receiver's second check finds it gone.
  const std::uint64_t position = tail - link_.depth;
  std::atomic<std::uint64_t>& slot = slots_[position % Wire::slot_count(link_)];
  const std::uint64_t word = slot.load(std::memory_order_relaxed);
  if (position_of(word) != position) {
    return true;
  }
  slot.store(LinkOut::kClosing, std::memory_order_seq_cst);
  if (in.taking.load(std::memory_order_seq_cst) <= position && take_back(word)) {
    add(overflowed_);
  }
  return true;
}

/// Writes the bytes of `payload` into the buffer of `number`; false if the segment is full.
bool Export::serialize(const google::protobuf::Message& payload, std::uint16_t number) noexcept {
  constexpr std::size_t kAlignment = 64;
  Buffer& buffer = buffers_[number];
  const auto size = static_cast<std::size_t>(std::max(0, payload.GetCachedSize()));
  if (size > buffer.capacity || buffer.bytes == nullptr) {
    buffer.bytes.reset();
    // Sizes vary: half as much more, so that few messages allocate.
    buffer.capacity = size + size / 2 + kAlignment;
    buffer.bytes.reset(
        static_cast<char*>(base::shared_memory.allocator->allocate(buffer.capacity, kAlignment)));
    if (buffer.bytes == nullptr) {
      buffer.capacity = 0;
      return false;
    }
  }
  payload.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(buffer.bytes.get()));
  messages_[number].bytes.store(buffer.bytes.get(), std::memory_order_relaxed);
  messages_[number].byte_count.store(size, std::memory_order_relaxed);
  return true;
}

void Export::put(detail::Envelope& envelope) noexcept {
  collect();
  out_.sequence.store(envelope.info.sequence, std::memory_order_relaxed);
  if (!is_connected()) {
    detail::release(&envelope);
    return;
  }
  if (!link_.is_serialized && !base::shared_memory.is_own(envelope.payload)) {
    add(unshared_);
    detail::release(&envelope);
    return;
  }
  const std::uint64_t tail = out_.tail.load(std::memory_order_relaxed);
  if (!make_room(tail)) {
    add(overflowed_);
    detail::release(&envelope);
    return;
  }
  if (free_.empty()) {
    add(over_quota_);
    detail::release(&envelope);
    return;
  }
  const std::uint16_t number = free_.back();
  if (link_.is_serialized && !serialize(*envelope.payload, number)) {
    add(unshared_);
    detail::release(&envelope);
    return;
  }
  free_.pop_back();
  // As `share` computed it.
  held_[number] = {
      .envelope = link_.is_serialized ? nullptr : &envelope,
      .given = tail + 1,
      .bytes = static_cast<std::uint64_t>(std::max(0, envelope.payload->GetCachedSize()))};
  bytes_out_ += held_[number].bytes;
  WireMessage& message = messages_[number];
  message.payload = envelope.payload;
  message.info = envelope.info;
  message.position.store(tail, std::memory_order_relaxed);
  for (std::size_t root = 0; root < wire_.plan().roots; ++root) {
    trails_[number * wire_.plan().roots + root] = envelope.trails[root];
  }
  if (link_.is_serialized) {
    add(copied_);
    detail::release(&envelope);
  }
  message.receiver.store(receiver_, std::memory_order_release);
  slots_[tail % Wire::slot_count(link_)].store(to_word(tail, number), std::memory_order_seq_cst);
  out_.tail.store(tail + 1, std::memory_order_seq_cst);
  add(given_);
  ++given_to_receiver_;
  bell_.fetch_add(1, std::memory_order_seq_cst);
  if (wire_.sleepers(link_.to, receiver_, link_.executor).load(std::memory_order_seq_cst) != 0) {
    wake(bell_, 1);
  }
}

}  // namespace fastcycle::segment
