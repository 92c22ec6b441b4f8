#include "broker/publisher_core.h"

#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "base/prefetch.h"
#include "base/shared_memory.h"
#include "broker/activation_check.h"
#include "broker/topic.h"
#include "broker/wake_list.h"
#include "fastcycle/assert.h"

namespace fastcycle::detail {
namespace {

/// Ends the process if `publisher` has no credits.
void check_credits(const PublisherCore& publisher) noexcept {
  if (publisher.credits() == nullptr) [[unlikely]] {
    broke_contract(publisher.owner,
                   fmt::format("its publisher on \"{}\" is asked for credits, and has none",
                               publisher.topic.name),
                   "say PublisherOptions::credits, or \"credits\" of the topic");
  }
}

/// Subscriptions made while the application runs whose samples are counted; those of more are not.
constexpr std::size_t kLateHolders = 8;
/// Loans that a component may hold at once beyond the messages of its pool.
constexpr std::size_t kLoansBeyondPool = 64;

}  // namespace

PublisherCore::PublisherCore(Topic& topic_, PublishingComponent& owner_, PublisherId id_,
                             const google::protobuf::Message& default_instance_,
                             const google::protobuf::Message* prototype, const Options& options_)
    : topic(topic_),
      owner(owner_),
      id(id_),
      options(options_),
      root_count(topic_.root_count),
      default_instance(default_instance_),
      prototype_(prototype == nullptr ? nullptr : prototype->New()),
      pool_(new Pool(&default_instance_, topic_.root_count)),
      forwards_(new Pool(nullptr, topic_.root_count)),
      shares_(topic_, owner_, options_.keep, options_.latched, options_.pool_max) {
  if (prototype_ != nullptr) {
    prototype_->CopyFrom(*prototype);
  }
  pool_->grow(shares_.needed(), prototype_.get());
  provided_ = shares_.needed();
  latched_.reserve(options.latched);
  owner.publishers.push_back(id);
  use_credits(topic.options.credits);
  if (owner.stage != nullptr) {
    pool_->collect_by_hand();
    forwards_->collect_by_hand();
  }
}

PublisherCore::~PublisherCore() {
  if (credits_ != nullptr) {
    credits_->leave();
  }
  for (const Target& target : targets_) {
    target.lane->is_left_by_publisher.store(true);
  }
  for (Envelope* envelope : latched_) {
    release(envelope);
  }
  for (Envelope* list : {scratch_loans_, scratch_forwards_}) {
    while (list != nullptr) {
      Envelope* next = list->next;
      list->pool->put_back(list);
      list = next;
    }
  }
  pool_->close();
  forwards_->close();
}

/// How many of the last messages a new lane gets: what its subscriber asks for, and no more than it
/// has room for, whatever a full queue would drop.
std::size_t PublisherCore::count_latched_for(const Lane& lane) const noexcept {
  std::size_t count = std::min(
      {latched_.size(), lane.options.depth, static_cast<std::size_t>(lane.options.history)});
  if (options.lifespan) {
    const Time now = owner.clock->now();
    while (count > 0 &&
           now - latched_[latched_.size() - count]->info.publish_time > *options.lifespan) {
      --count;
    }
  }
  return count;
}

void PublisherCore::distinguish_holders(std::size_t count) {
  if (published() > 0) {
    return;  // Holders are counted already, or not at all.
  }
  pool_->distinguish_holders(count, kLateHolders);
  forwards_->distinguish_holders(count, kLateHolders);
}

void PublisherCore::check_loans() const {
  if (loans_ < shares_.limit() + kLoansBeyondPool || owner.replayed != nullptr) {
    return;
  }
  const std::string why = fmt::format(
      "component \"{}\" holds {} loans of \"{}\" that it has neither published nor let "
      "go of, and its pool may have {} messages: publish each loan, or let it go out "
      "of scope",
      owner.name, loans_, topic.name, shares_.limit());
  owner.refused(loan_in_words(), why);
  throw std::length_error(why);
}

std::string PublisherCore::loan_in_words() const {
  return fmt::format("loan {} of {}", loans_ + 1, topic.name);
}

void PublisherCore::check_replayed_loan() const {
  if (const auto why = owner.replayed_refusal(loan_in_words())) {
    throw std::length_error(*why);
  }
}

void PublisherCore::connect(const std::shared_ptr<Lane>& lane, Inbox& inbox) {
  const auto lock =
      gate_ == nullptr ? std::unique_lock<base::PriorityMutex>() : std::unique_lock(gate_->mutex);
  shares_.join(*lane);
  for (Pool* pool : {pool_, forwards_}) {
    pool->declare_kept(lane->subscription.holder, lane->subscription.keep + options.keep);
  }
  if (shares_.needed() > provided_) {
    pool_->grow(shares_.needed() - provided_, prototype_.get());
    provided_ = shares_.needed();
  }
  const std::uint64_t bit = Inbox::bit_of(*lane);
  const std::size_t given = count_latched_for(*lane);
  for (std::size_t i = latched_.size() - given; i < latched_.size(); ++i) {
    retain(*latched_[i]);
    if (Envelope* displaced = lane->push(latched_[i])) {
      release(displaced);
    }
  }
  targets_.push_back({lane, &inbox, bit});
  if (lane->credit != nullptr) {
    credits_->add(lane);
  }
  if (lane->is_closed()) {
    lane->dropped_after_close.add(lane->drain());
  }
  if (given > 0 && bit != 0 && inbox.mark(*lane, bit)) {
    inbox.queue().wake();
  }
}

void PublisherCore::provide_for(const Lane::Options& lane, std::size_t keep) {
  const std::size_t count = lane.depth + 1 + keep;
  pool_->grow(count, prototype_.get());
  pool_->provide_for_late_holders();
  forwards_->provide_for_late_holders();
  provided_ += count;
  targets_.reserve(targets_.size() + 1);
}

void PublisherCore::disconnect(const Lane& lane) noexcept {
  const auto lock =
      gate_ == nullptr ? std::unique_lock<base::PriorityMutex>() : std::unique_lock(gate_->mutex);
  std::erase_if(targets_, [&](const Target& target) {
    if (target.lane.get() != &lane) {
      return false;
    }
    if (lane.credit != nullptr) {
      credits_->remove(lane);
    }
    target.lane->is_left_by_publisher.store(true);
    shares_.leave(lane);
    return true;
  });
}

Envelope* PublisherCore::take_from(Pool& pool, Envelope*& scratch) {
  if (Envelope* envelope = pool.take()) {
    return envelope;
  }
  check_loans();
  shares_.note_shortage();
  // No limit in simulated time: losses must not depend on how fast observers and foreign threads
  // release messages.
  if (pool.size() < shares_.limit() || owner.stage != nullptr) {
    pool.grow(1, prototype_.get());
    return pool.take();
  }
  shares_.report_shortage(targets_, pool, loans_);
  if (scratch == nullptr) {
    pool.grow(1, prototype_.get());
    scratch = pool.take();
    scratch->next = nullptr;
    scratch->is_scratch = true;
  }
  return std::exchange(scratch, scratch->next);
}

Envelope* PublisherCore::loan(bool is_cleared) {
  // The last returned message is warm, in caches and in pages; but in a burst its list belongs to
  // the readers: once it was collected in this activation, the pool's own are lent. An external
  // publisher is in no activation, and may not look at its owner's.
  const bool is_first = options.is_external || owner.publish_count == 0 ||
                        (owner.stage == nullptr && last_publish_time() < owner.now);
  if (owner.stage == nullptr && is_first) {
    pool_->collect();
  }
  if (!exports_.empty()) [[unlikely]] {
    base::enter_shared_scope();  // Until it is published, or returned.
    if (is_first) {
      for (MessageExport* const to : exports_) {
        to->collect();
      }
    }
  }
  Envelope* envelope = take_from(*pool_, scratch_loans_);
  base::prefetch_for_writing(&envelope->info);
  ++loans_;
  if (is_cleared) {
    envelope->own->Clear();
  }
  return envelope;
}

void PublisherCore::return_loan(Envelope* loan) noexcept {
  if (!exports_.empty()) {
    base::leave_shared_scope();
  }
  give_loan_back(loan);
}

void PublisherCore::add_export(MessageExport& to) {
  exports_.push_back(&to);
  if (credits_ != nullptr && to.returns_credits()) {
    credits_->add(to);
  }
  // Those that it may hold, as a lane's.
  base::enter_shared_scope();
  pool_->make_free_ones_anew();
  pool_->grow(to.capacity(), prototype_.get());
  base::leave_shared_scope();
  provided_ += to.capacity();
  shares_.join_export(to.capacity());
}

/// Ends the loan's scope. Makes the message readable for other processes.
void PublisherCore::share(Envelope& loan) noexcept {
  if (exports_.empty()) [[likely]] {
    return;
  }
  base::enter_shared_scope();  // Its own is over if it was lent in an earlier activation.
  loan.own = exports_.front()->share(loan.own);
  base::leave_shared_scope();
  base::leave_shared_scope();
}

/// A copy, as a loan, of another publisher's message: that publisher may end before the receivers.
Envelope* PublisherCore::copy_for_export(const Envelope& received) {
  Envelope* const copy = loan(false);
  copy->own->CopyFrom(*received.payload);
  share(*copy);
  --loans_;
  copy->payload = copy->own;
  return copy;
}

void PublisherCore::give_loan_back(Envelope* loan) noexcept {
  --loans_;
  if (loan->is_scratch) {
    loan->next = std::exchange(scratch_loans_, loan);
  } else {
    pool_->put_back(loan);
  }
}

void PublisherCore::prepare() const noexcept {
  // The lines that the receivers wrote last travel here together, not one after the other.
  const std::size_t count = std::min<std::size_t>(targets_.size(), 4);
  for (std::size_t i = 0; i < count; ++i) {
    if (!targets_[i].inbox->is_watched()) {
      targets_[i].lane->prepare_push();
    }
    targets_[i].inbox->prepare_mark();
  }
}

void PublisherCore::number(Envelope& envelope, const Origin& origin, Time now) noexcept {
  published_.add();
  envelope.info.sequence = published_.get();
  // Simulated messages of one round share its time; their order is (publisher, sequence).
  const bool is_simulated = owner.stage != nullptr;
  envelope.info.publish_time =
      is_simulated ? now : std::max(now, last_publish_time() + Duration(1));
  envelope.info.publisher = id;
  envelope.info.origin = origin;
  last_publish_time_.store(envelope.info.publish_time, std::memory_order_relaxed);
  if (first_publish_ns_.load(std::memory_order_relaxed) == 0) {
    first_publish_ns_.store(base::monotonic_ns(), std::memory_order_relaxed);
  }
}

/// The message's trails are those that led to it, and one hop more.
void PublisherCore::follow(Envelope& envelope, const Trail* cause,
                           const Trail* held) const noexcept {
  const MessageInfo& info = envelope.info;
  for (std::size_t root = 0; root < root_count; ++root) {
    Trail& trail = envelope.trails[root];
    if (topic.root == root) {
      trail.begin(info.origin.taken, id, info.publish_time);
      continue;
    }
    const bool is_caused = cause != nullptr && cause[root].is_known();
    const Trail* before = is_caused ? cause : held;
    if (before == nullptr || !before[root].is_known()) {
      trail.forget();
      continue;
    }
    trail = before[root];
    trail.add({.publisher = id, .begin = owner.now, .published = info.publish_time});
  }
}

void PublisherCore::follow(Envelope& envelope, const Arrival& arrival, Time now) const noexcept {
  for (std::size_t root = 0; root < root_count; ++root) {
    Trail& trail = envelope.trails[root];
    if (root < arrival.trails.size() && arrival.trails[root].is_known()) {
      trail = arrival.trails[root];
      // The last publish there may seem to be later, by as much as the clocks are known to differ.
      const Time begin = std::clamp(trail.hops().back().published, arrival.came, now);
      trail.add({.publisher = id, .begin = begin, .published = now});
    } else if (topic.root == root) {
      trail.begin(envelope.info.origin.taken, id, now);
    } else {
      trail.forget();
    }
  }
}

void PublisherCore::count_lost(std::uint64_t count) noexcept {
  for (const Target& target : targets_) {
    target.lane->subscription.lost_on_link.fetch_add(count, std::memory_order_relaxed);
  }
}

Time PublisherCore::read_last_publish_time() noexcept {
  if (!options.is_external) {
    return last_publish_time_;
  }
  const std::lock_guard lock(mutex_);
  return last_publish_time_;
}

void PublisherCore::send(Envelope* envelope, Stage* stage) noexcept {
  if (stage != nullptr) {
    envelope->references.store(1, std::memory_order_relaxed);
    stage->put(*this, envelope);
  } else {
    deliver(envelope);
  }
}

void PublisherCore::publish(Envelope* loan, const PublishOptions& options_) {
  if (!owner.is_active_here() || owner.is_muted) [[unlikely]] {
    drop_muted(loan);
    return;
  }
  Origin origin = *owner.origin;
  if (options_.taken_at || origin.root == 0) {
    origin = {.taken = options_.taken_at.value_or(owner.now), .root = id};
  }
  if (owner.publish_count++ == 0) {
    prepare();
  }
  --loans_;
  share(*loan);
  loan->payload = loan->own;
  if (followed_ != nullptr) [[unlikely]] {
    loan->info.origin = origin;
    send_following(loan, options_.taken_at ? nullptr : owner.trails,
                   options_.taken_at ? nullptr : owner.held_trails);
    return;
  }
  const bool is_simulated = owner.stage != nullptr;
  number(*loan, origin, is_simulated ? owner.now + owner.simulated_cost : owner.clock->now());
  owner.published = loan->info.publish_time;
  if (root_count != 0) [[unlikely]] {
    // A new measurement inherits no trails.
    follow(*loan, options_.taken_at ? nullptr : owner.trails,
           options_.taken_at ? nullptr : owner.held_trails);
  }
  send(loan, owner.stage);
}

void PublisherCore::forward(Envelope* received, Holder holder) {
  if (!owner.is_active_here() || owner.is_muted) [[unlikely]] {
    drop_muted(nullptr);
    return;
  }
  if (owner.publish_count++ == 0) {
    prepare();
  }
  Envelope* envelope = nullptr;
  if (!exports_.empty()) [[unlikely]] {
    envelope = copy_for_export(*received);
  } else {
    if (forwards_->size() == 0) {
      forwards_->grow(shares_.needed());
    }
    envelope = take_from(*forwards_, scratch_forwards_);
    envelope->is_forwarded_again = received->foreign != nullptr;
    Envelope* foreign = envelope->is_forwarded_again ? received->foreign : received;
    retain(*foreign);
    envelope->foreign = foreign;
    foreign->pool->count_forwarded(
        *envelope, envelope->is_forwarded_again ? received->foreign_holder : holder);
    envelope->payload = foreign->payload;
  }
  Origin origin = *owner.origin;
  const bool is_forwarded_alone = origin.root == 0;  // Nothing that was delivered led here.
  if (is_forwarded_alone) {
    origin = received->info.origin;
  }
  if (followed_ != nullptr) [[unlikely]] {
    envelope->info.origin = origin;
    send_following(envelope, is_forwarded_alone ? received->trails : owner.trails,
                   owner.held_trails);
    return;
  }
  const bool is_simulated = owner.stage != nullptr;
  number(*envelope, origin, is_simulated ? owner.now + owner.simulated_cost : owner.clock->now());
  owner.published = envelope->info.publish_time;
  if (root_count != 0) [[unlikely]] {
    follow(*envelope, is_forwarded_alone ? received->trails : owner.trails, owner.held_trails);
  }
  send(envelope, owner.stage);
}

void PublisherCore::follow(OutputComparer& comparer) {
  const std::lock_guard lock(mutex_);
  followed_ = std::make_unique<FollowedOutputs>(*this, comparer);
}

void PublisherCore::stop_following() {
  const std::lock_guard lock(mutex_);
  followed_->clear();
  followed_->is_following = false;
  // Later subscribers receive these; the memory of the other process is not used for that.
  for (Envelope*& kept : latched_) {
    Envelope* const copy = loan(false);
    copy->own->CopyFrom(*kept->payload);
    share(*copy);
    --loans_;
    copy->payload = copy->own;
    copy->info = kept->info;
    copy->references.store(1, std::memory_order_relaxed);
    release(std::exchange(kept, copy));
  }
  if (followed_->made >= published_.get()) {
    followed_.reset();
  }
}

void PublisherCore::continue_following_after(std::uint64_t sequence) {
  const std::lock_guard lock(mutex_);
  followed_->clear_own();
  followed_->made = sequence;
}

const Envelope* PublisherCore::find_followed(std::uint64_t sequence, bool& is_past) const noexcept {
  const Envelope* const found = followed_->find_theirs(sequence);
  is_past = found == nullptr && followed_->is_past(sequence);
  return found;
}

void PublisherCore::skip_followed() {
  const std::lock_guard lock(mutex_);
  followed_.reset();
}

/// For a message that the component publishes while it is a standby, or again when it takes over.
void PublisherCore::send_following(Envelope* envelope, const Trail* cause, const Trail* held) {
  const std::lock_guard lock(mutex_);
  MessageInfo& info = envelope->info;
  info.sequence = ++followed_->made;
  info.publisher = id;
  info.publish_time = std::max(owner.clock->now(), last_publish_time() + Duration(1));
  owner.published = info.publish_time;
  if (root_count != 0) [[unlikely]] {
    follow(*envelope, cause, held);
  }
  if (followed_->is_following) {
    envelope->references.store(1, std::memory_order_relaxed);
    followed_->add_own(envelope);
    return;
  }
  if (info.sequence > published_.get()) {  // Not even here it came from the other one.
    followed_.reset();
    published_.set(info.sequence);
    handed_over_ = info.sequence;
    last_publish_time_.store(info.publish_time, std::memory_order_relaxed);
    put_into_lanes(envelope);
    return;
  }
  envelope->references.store(1 + static_cast<std::uint32_t>(exports_.size()),
                             std::memory_order_relaxed);
  for (MessageExport* const to : exports_) {
    to->put(*envelope);
  }
  release(envelope);
  if (followed_->made == published_.get()) {
    followed_.reset();
  }
}

void PublisherCore::publish_external(Envelope* loan, Time taken_at) {
  const std::lock_guard lock(mutex_);
  if (is_external_muted_) {
    muted_.add();
    return_loan(loan);
    return;
  }
  share(*loan);
  loan->payload = loan->own;
  number(*loan, {.taken = taken_at, .root = id}, owner.clock->now());
  if (root_count != 0) [[unlikely]] {
    follow(*loan, nullptr, nullptr);
  }
  if (is_open_) {
    --loans_;
    send(loan, external_stage_);
  } else {
    drop_outside(loan);
  }
}

void PublisherCore::publish_arrived(Envelope* loan, const Arrival& arrival) {
  const std::lock_guard lock(mutex_);
  if (is_external_muted_) {
    muted_.add();
    return_loan(loan);
    return;
  }
  if (arrival.lost > 0) {
    count_lost(arrival.lost);
  }
  loan->payload = loan->own;
  Origin origin = arrival.origin;
  if (origin.root == 0) {
    origin.root = id;
  }
  const Time now = owner.clock->now();
  const bool is_simulated = owner.stage != nullptr;
  number(*loan, origin, is_simulated ? now : std::min(now, arrival.published));
  if (root_count != 0) [[unlikely]] {
    follow(*loan, arrival, now);
  }
  if (is_open_) {
    --loans_;
    send(loan, external_stage_);
  } else {
    drop_outside(loan);
  }
}

void PublisherCore::publish_again(Envelope* loan, const MessageInfo& info) {
  const std::lock_guard lock(mutex_);
  published_.add();
  share(*loan);
  loan->payload = loan->own;
  loan->info = info;
  loan->info.publisher = id;
  if (info.origin.root == 0) {
    loan->info.origin.root = id;
  }
  if (root_count != 0) [[unlikely]] {
    follow(*loan, nullptr, nullptr);
  }
  last_publish_time_.store(std::max(last_publish_time(), info.publish_time),
                           std::memory_order_relaxed);
  if (first_publish_ns_.load(std::memory_order_relaxed) == 0) {
    first_publish_ns_.store(base::monotonic_ns(), std::memory_order_relaxed);
  }
  if (is_open_) {
    --loans_;
    deliver(loan);
  } else {
    drop_outside(loan);
  }
}

void PublisherCore::drop_outside(Envelope* loan) noexcept {
  // No component is served before the start and after the stop.
  ++handed_over_;
  for (const Target& target : targets_) {
    target.lane->published.add();
    target.lane->dropped_outside.add();
  }
  give_loan_back(loan);
}

void PublisherCore::lose_imported(std::uint64_t count) noexcept {
  for (const Target& target : targets_) {
    target.lane->published.add(count);
    target.lane->dropped_outside.add(count);
  }
  published_.add(count);
  handed_over_ += count;
}

void PublisherCore::publish_imported(Envelope* envelope, bool may_repeat) noexcept {
  const std::uint64_t sequence = envelope->info.sequence;
  const std::uint64_t last = published_.get();
  if (may_repeat && sequence <= std::exchange(imported_, std::max(imported_, sequence))) {
    envelope->references.store(0, std::memory_order_relaxed);
    recycle(envelope);
    return;
  }
  if (sequence > last + 1) {
    lose_imported(sequence - last - 1);
  }
  published_.set(sequence);
  handed_over_ = sequence;
  last_publish_time_.store(std::max(last_publish_time(), envelope->info.publish_time),
                           std::memory_order_relaxed);
  if (first_publish_ns_.load(std::memory_order_relaxed) == 0) {
    first_publish_ns_.store(base::monotonic_ns(), std::memory_order_relaxed);
  }
  if (followed_ != nullptr) [[unlikely]] {
    put_followed(envelope);
  } else {
    put_into_lanes(envelope);
  }
}

void PublisherCore::publish_copied(Envelope* loan, const MessageInfo& info,
                                   std::span<const Trail> trails) noexcept {
  --loans_;
  loan->payload = loan->own;
  loan->info = info;
  loan->info.publisher = id;
  std::ranges::copy(trails, loan->trails);
  if (owner.stage != nullptr) {
    pool_->collect();  // It is between rounds.
  }
  publish_imported(loan, false);
}

/// Delivers a message of the followed publisher to its subscribers here.
void PublisherCore::put_followed(Envelope* envelope) noexcept {
  envelope->references.store(
      static_cast<std::uint32_t>(targets_.size()) + (options.latched > 0 ? 2 : 1),
      std::memory_order_relaxed);
  if (options.latched > 0) {
    keep_latched(envelope);
  }
  WakeList wakes;
  for (const Target& target : targets_) {
    push(target, envelope, topic, wakes);
  }
  wakes.wake_all();
  followed_->add_theirs(envelope);
}

void PublisherCore::drop_muted(Envelope* loan) noexcept {
  if (!owner.is_active_here()) {
    called_outside(owner, "publish on", topic.name, kPublishFromThreads);
  }
  muted_.add();
  if (loan != nullptr) {
    return_loan(loan);
  }
}

void PublisherCore::drop_scratch(Envelope* scratch) noexcept {
  for (const Target& target : targets_) {
    target.lane->published.add();
    target.lane->dropped_by_pool.add();
  }
  auto& list = scratch->foreign != nullptr ? scratch_forwards_ : scratch_loans_;
  if (Envelope* foreign = scratch->foreign) {
    foreign->pool->count_came_back(*scratch);
    scratch->foreign = nullptr;
    release(foreign);
  }
  scratch->next = std::exchange(list, scratch);
}

void PublisherCore::deliver(Envelope* envelope) noexcept {
  if (owner.stage != nullptr) {
    hand_over(envelope);
  } else {
    put_into_lanes(envelope);
  }
}

void PublisherCore::hand_over(Envelope* envelope) noexcept {
  pool_->collect();
  forwards_->collect();
  ++handed_over_;
  put_into_lanes(envelope);
  if (awaits_when_handed_over_ && staged() == 0) {
    awaits_when_handed_over_ = false;
    credits_->await();
  }
}

[[gnu::always_inline]] inline void PublisherCore::push(const Target& target, Envelope* envelope,
                                                       const Topic& topic,
                                                       WakeList& wakes) noexcept {
  Lane& lane = *target.lane;
  if (Envelope* displaced = lane.push(envelope)) {
    release(displaced);
    if (topic.overflow_watch != nullptr && !lane.options.is_view) {
      topic.overflow_watch->overflowed(lane.subscription);
    }
  }
  if (target.bit != 0 && target.inbox->mark(lane, target.bit)) {
    wakes.add(target.inbox->queue());
  }
  if (lane.is_closed()) {
    lane.dropped_after_close.add(lane.drain());
  }
}

void PublisherCore::put_into_lanes(Envelope* envelope) noexcept {
  if (envelope->is_scratch) {
    drop_scratch(envelope);
    return;
  }
  if (gate_ != nullptr) [[unlikely]] {
    put_through_gate(envelope);
    return;
  }
  const Pool& pool = *envelope->pool;
  const std::size_t held_back =
      shares_.must_look(pool) ? shares_.find_held_back(targets_, pool) : 0;
  const std::size_t count =
      targets_.size() - held_back + (options.latched > 0 ? 1 : 0) + exports_.size();
  if (count == 0) {
    for (const Target& target : targets_) {
      shares_.hold_back(*target.lane, pool);
    }
    envelope->references.store(0, std::memory_order_relaxed);
    recycle(envelope);
    return;
  }
  envelope->references.store(static_cast<std::uint32_t>(count), std::memory_order_relaxed);
  if (options.latched > 0) {
    keep_latched(envelope);
  }
  WakeList wakes;
  for (const Target& target : targets_) {
    Lane& lane = *target.lane;
    if (lane.is_held_back) [[unlikely]] {
      shares_.hold_back(lane, pool);
      continue;
    }
    push(target, envelope, topic, wakes);
  }
  wakes.wake_all();
  for (MessageExport* const to : exports_) {
    to->put(*envelope);
  }
}

/// Observers are given what was published. Another process has a gate of its own.
void PublisherCore::put_through_gate(Envelope* envelope) noexcept {
  const std::lock_guard lock(gate_->mutex);
  const Pool& pool = *envelope->pool;
  if (shares_.must_look(pool)) {
    static_cast<void>(shares_.find_held_back(targets_, pool));
  }
  envelope->references.store(1 + static_cast<std::uint32_t>(exports_.size()),
                             std::memory_order_relaxed);
  if (options.latched > 0) {
    retain(*envelope);
    keep_latched(envelope);
  }
  gate_->begin(*envelope);
  for (const Target& target : targets_) {
    Lane& lane = *target.lane;
    if (lane.is_held_back) {
      shares_.hold_back(lane, pool);
    } else if (lane.subscription.kind == Subscription::Kind::kTap) {
      retain(*envelope);
      WakeList wakes;
      push(target, envelope, topic, wakes);
      wakes.wake_all();
    } else {
      gate_->pass(*envelope, lane.subscription);
    }
  }
  gate_->end(*envelope);
  for (MessageExport* const to : exports_) {
    to->put(*envelope);
  }
  release(envelope);
}

bool PublisherCore::put_behind_gate(const Subscription& subscription, Envelope* envelope) noexcept {
  const auto target = std::ranges::find_if(
      targets_, [&](const Target& one) { return &one.lane->subscription == &subscription; });
  if (target == targets_.end()) {
    release(envelope);
    return false;
  }
  WakeList wakes;
  push(*target, envelope, topic, wakes);
  wakes.wake_all();
  return true;
}

void PublisherCore::give_latched(MessageExport& to, std::size_t count) noexcept {
  for (std::size_t i = latched_.size() - std::min(latched_.size(), count); i < latched_.size();
       ++i) {
    retain(*latched_[i]);
    to.put(*latched_[i]);
  }
}

void PublisherCore::keep_latched(Envelope* envelope) noexcept {
  if (latched_.size() == options.latched) {
    release(latched_.front());
    latched_.erase(latched_.begin());
  }
  latched_.push_back(envelope);
}

void PublisherCore::use_credits(std::size_t window) {
  if (window > 0 && credits_ == nullptr) {
    credits_ = std::make_shared<Credits>(window);
  }
}

std::size_t PublisherCore::ask_credits() {
  check_credits(*this);
  if (!owner.is_active_here()) [[unlikely]] {
    called_outside(owner, "credits() of", topic.name,
                   "an ExternalPublisher can be asked by your own thread");
  }
  if (owner.is_muted) {
    return 0;  // Its messages are not delivered, so no credits are returned.
  }
  if (!is_asked_) {
    is_asked_ = true;
    granted_ = owner.learn(ReadKind::kCredits, id, [this] { return credits_->left(staged()); });
    granted_at_ = published_.get();
    owner.asked.push_back(this);
    owner.has_leftovers = true;
  }
  return granted_ - std::min<std::uint64_t>(granted_, published_.get() - granted_at_);
}

bool PublisherCore::end_asking() noexcept {
  is_asked_ = false;
  return published_.get() - granted_at_ >= granted_;
}

bool PublisherCore::take_returned_credits() noexcept {
  if (!credits_->take_returned()) {
    return false;
  }
  if (credits_->left(staged()) > 0) {
    return true;
  }
  // Staged messages use up credits, but are not in the lanes yet: waiting would end at once,
  // repeatedly, before the end of the round.
  if (staged() > 0) {
    awaits_when_handed_over_ = true;
  } else {
    credits_->await();
  }
  return false;
}

std::size_t PublisherCore::ask_external_credits() {
  check_credits(*this);
  const std::lock_guard lock(mutex_);
  return is_external_muted_ ? 0 : credits_->left(staged());
}

void PublisherCore::set_external_muted(bool is_muted) noexcept {
  is_external_muted_ = is_muted;
  if (credits_ != nullptr) {
    credits_->wake();
  }
}

bool PublisherCore::wait_for_credit(const std::stop_token& stop) {
  check_credits(*this);
  const std::stop_callback wake_up(stop, [this] { credits_->wake(); });
  for (;;) {
    // Read before everything whose change it announces: the stop, the credits, the mute state.
    const std::uint32_t epoch = credits_->epoch();
    if (stop.stop_requested()) {
      return false;
    }
    {
      const std::lock_guard lock(mutex_);
      static_cast<void>(credits_->take_returned());
      if (!is_external_muted_) {
        if (credits_->left(staged()) > 0) {
          return true;
        }
        credits_->await();
      }
    }
    // Woken by what came, or by `stop`: also if that was before this.
    credits_->wait_beyond(epoch);
  }
}

std::size_t PublisherCore::count_subscribers() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(targets_, [](const Target& target) {
    return target.lane->subscription.kind != Subscription::Kind::kTap;
  }));
}

}  // namespace fastcycle::detail
