#include "broker/pool.h"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

#include <malloc.h>

#include "base/prefetch.h"
#include "base/shared_memory.h"

namespace fastcycle::detail {
namespace {

static_assert(sizeof(Envelope) == 128, "two lines: one for readers, one for the pool");

/// Poisoned messages of one pool whose bytes are still to be seen.
constexpr std::size_t kQuarantined = 64;

/// So often it is looked whether a component forwards more than it may keep.
constexpr std::uint32_t kForwardsPerLook = 8;

#if defined(__SANITIZE_ADDRESS__)
constexpr Poison kUsualPoison = Poison::kFree;
#elif defined(NDEBUG)
constexpr Poison kUsualPoison = Poison::kOff;
#else
constexpr Poison kUsualPoison = Poison::kPattern;
#endif

/// The value of `returned_` once the publisher is gone.
Envelope* closed_mark() noexcept {
  static Envelope mark;
  return &mark;
}

}  // namespace

Poison poison_of_environment() noexcept {
  const char* const given = std::getenv("FASTCYCLE_POISON");
  const std::string_view word = given == nullptr ? "" : given;
  return word == "off"       ? Poison::kOff
         : word == "pattern" ? Poison::kPattern
         : word == "free"    ? Poison::kFree
                             : kUsualPoison;
}

void keep(Envelope& envelope, Holder holder) noexcept {
  envelope.pool->count_kept(envelope, holder);
}

void let_go(Envelope& envelope, Holder holder) noexcept {
  envelope.pool->count_let_go(envelope, holder);
}

void recycle(Envelope* envelope) noexcept {
  if (Envelope* foreign = envelope->foreign) {
    foreign->pool->count_came_back(*envelope);
    envelope->foreign = nullptr;
    release(foreign);
  }
  envelope->pool->give_back(envelope);
}

Pool::Pool(const google::protobuf::Message* default_instance, std::size_t trails, Poison poison)
    : default_instance_(default_instance),
      trail_count_(trails),
      poison_(poison),
      poison_of_returned_(poison) {}

Pool::~Pool() {
  for (void* remains : quarantine_) {
    ::operator delete(remains);
  }
  delete[] late_kept_.load(std::memory_order_relaxed);
}

void Pool::add_counts(Slab& slab) const {
  const std::size_t holders = holder_count_ + late_count_;
  slab.kept_samples = std::make_unique<std::atomic<std::uint32_t>[]>(slab.count * holders);
  for (std::size_t i = 0; i < slab.count; ++i) {
    slab.envelopes[i].kept_samples = &slab.kept_samples[i * holders];
  }
}

void Pool::distinguish_holders(std::size_t count, std::size_t late_count) {
  holder_count_ = count;
  late_count_ = late_count;
  kept_ = std::make_unique<Kept[]>(count);
  for (Slab& slab : slabs_) {
    add_counts(slab);
  }
}

void Pool::provide_for_late_holders() {
  if (late_count_ > 0 && late_kept_.load(std::memory_order_relaxed) == nullptr) {
    late_kept_.store(std::make_unique<Kept[]>(late_count_).release(), std::memory_order_release);
  }
}

void Pool::declare_kept(Holder holder, std::size_t count) {
  if (holder >= holder_count_ && holder - holder_count_ < late_count_) {
    provide_for_late_holders();
  }
  if (Kept* const kept = find_kept(holder)) {
    kept->declared.store(count, std::memory_order_relaxed);
  }
}

void Pool::count_kept(Envelope& envelope, Holder holder) noexcept {
  Kept* const kept = find_kept(holder);
  if (kept == nullptr ||
      envelope.kept_samples[holder].fetch_add(1, std::memory_order_relaxed) != 0) {
    return;
  }
  kept->messages.fetch_add(1, std::memory_order_relaxed);
  if (kept->is_too_much() && !is_overdrawn()) {
    is_overdrawn_.store(true, std::memory_order_relaxed);
  }
}

void Pool::count_let_go(Envelope& envelope, Holder holder) noexcept {
  Kept* const kept = find_kept(holder);
  if (kept != nullptr &&
      envelope.kept_samples[holder].fetch_sub(1, std::memory_order_relaxed) == 1) {
    kept->messages.fetch_sub(1, std::memory_order_relaxed);
  }
}

void Pool::count_forwarded(Envelope& forward, Holder holder) noexcept {
  forward.foreign_holder = holder;
  if (forward.is_forwarded_again) {
    count_kept(*forward.foreign, holder);
    return;
  }
  Kept* const kept = find_kept(holder);
  if (kept == nullptr) {
    return;
  }
  // On the way of a message: no step that waits for another CPU, but for one look now and then.
  const std::uint32_t count = kept->forwarded.load(std::memory_order_relaxed) + 1;
  kept->forwarded.store(count, std::memory_order_relaxed);
  if (count % kForwardsPerLook == 0 && kept->is_too_much() && !is_overdrawn()) {
    is_overdrawn_.store(true, std::memory_order_relaxed);
  }
}

void Pool::count_came_back(const Envelope& forward) noexcept {
  if (forward.is_forwarded_again) {
    count_let_go(*forward.foreign, forward.foreign_holder);
  } else if (Kept* const kept = find_kept(forward.foreign_holder)) {
    kept->came_back.fetch_add(1, std::memory_order_release);
  }
}

std::unique_ptr<google::protobuf::Message> Pool::make_message() const {
  std::unique_ptr<google::protobuf::Message> message(default_instance_->New());
  if (prototype_ != nullptr) {
    message->CopyFrom(*prototype_);
    message->Clear();
  }
  return message;
}

void Pool::grow(std::size_t count, const google::protobuf::Message* prototype) {
  prototype_ = prototype;
  // Side by side: less memory than one by one, and fewer pages.
  Slab slab{.count = count,
            .envelopes = std::make_unique<Envelope[]>(count),
            .trails = trail_count_ == 0 ? nullptr : std::make_unique<Trail[]>(count * trail_count_),
            .kept_samples = nullptr};
  if (holder_count_ + late_count_ > 0) {
    add_counts(slab);
  }
  for (std::size_t i = 0; i < count; ++i) {
    Envelope* envelope = &slab.envelopes[i];
    envelope->pool = this;
    envelope->trails = trail_count_ == 0 ? nullptr : &slab.trails[i * trail_count_];
    if (default_instance_ != nullptr) {
      envelope->own = make_message().release();
    }
    put_back(envelope);
    size_.fetch_add(1, std::memory_order_relaxed);
    outstanding_.fetch_add(1, std::memory_order_relaxed);
  }
  slabs_.push_back(std::move(slab));
}

/// By the last holder.
void Pool::poison(Envelope& envelope) noexcept {
  google::protobuf::Message* const message = std::exchange(envelope.own, nullptr);
  // Shared memory has a heap of its own, which writes into freed memory.
  if (poison_ == Poison::kFree || base::shared_memory.has(message)) {
    delete message;
    return;
  }
  envelope.remains = message;
  const std::size_t size = malloc_usable_size(envelope.remains);
  message->~Message();
  // Volatile: the writes must not be optimized away.
  std::fill_n(static_cast<volatile unsigned char*>(envelope.remains), size, kPoisonByte);
}

/// By the owner.
void Pool::revive(Envelope& envelope) {
  if (envelope.own != nullptr || default_instance_ == nullptr) {
    return;
  }
  envelope.own = make_message().release();
  if (void* const remains = std::exchange(envelope.remains, nullptr)) {
    quarantine_.push_back(remains);
    if (quarantine_.size() > kQuarantined) {
      ::operator delete(quarantine_.front());
      quarantine_.erase(quarantine_.begin());
    }
  }
}

Envelope* Pool::take() noexcept {
  if (free_ == nullptr && !is_collected_by_hand_) {
    collect();
  }
  Envelope* envelope = free_;
  if (envelope != nullptr) {
    free_ = envelope->next;
    if (free_ == nullptr) {
      free_ = envelope->next_list;
    } else {
      free_->next_list = envelope->next_list;
    }
    if (poison_ != Poison::kOff) [[unlikely]] {
      revive(*envelope);
    }
    prepare_following();
  }
  return envelope;
}

void Pool::prepare_following() const noexcept {
  // In a burst the next ones were read by another CPU just now.
  if (free_ == nullptr) {
    return;
  }
  base::prefetch_for_writing(free_->own);
  const auto* second = reinterpret_cast<const char*>(free_->next);
  base::prefetch_for_writing(second);
  base::prefetch_for_writing(second + 64);
}

void Pool::collect() noexcept {
  if (returned_.load(std::memory_order_relaxed) == nullptr) {
    return;
  }
  Envelope* list = returned_.exchange(nullptr, std::memory_order_acquire);
  list->next_list = free_;
  free_ = list;
}

void Pool::put_back(Envelope* envelope) noexcept {
  envelope->next_list = free_ != nullptr ? free_->next_list : nullptr;
  envelope->next = free_;
  free_ = envelope;
}

void Pool::make_free_ones_anew() {
  collect();
  for (Envelope* list = free_; list != nullptr; list = list->next_list) {
    for (Envelope* envelope = list; envelope != nullptr; envelope = envelope->next) {
      if (envelope->own != nullptr) {
        delete envelope->own;
        envelope->own = make_message().release();
      }
    }
  }
}

void Pool::give_back(Envelope* envelope) noexcept {
  if (sink_ != nullptr) [[unlikely]] {
    sink_->came_back(*envelope);
    return;
  }
  if (poison_of_returned_ != Poison::kOff && envelope->own != nullptr) [[unlikely]] {
    poison(*envelope);
  }
  Envelope* head = returned_.load(std::memory_order_acquire);
  do {
    if (head == closed_mark()) {
      envelope->next = nullptr;
      forget(free_all(envelope));
      return;
    }
    envelope->next = head;
  } while (!returned_.compare_exchange_weak(head, envelope, std::memory_order_release,
                                            std::memory_order_acquire));
}

std::size_t Pool::free_all(Envelope* list) noexcept {
  std::size_t count = 0;
  while (list != nullptr) {
    Envelope* next = list->next;
    delete list->own;
    ::operator delete(list->remains);
    list = next;
    ++count;
  }
  return count;
}

void Pool::forget(std::size_t count) noexcept {
  if (outstanding_.fetch_sub(count, std::memory_order_acq_rel) == count) {
    delete this;
  }
}

void Pool::close() noexcept {
  std::size_t freed = 0;
  while (free_ != nullptr) {
    freed += free_all(std::exchange(free_, free_->next_list));
  }
  freed += free_all(returned_.exchange(closed_mark(), std::memory_order_acq_rel));
  forget(freed + 1);
}

}  // namespace fastcycle::detail
