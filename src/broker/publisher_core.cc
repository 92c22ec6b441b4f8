#include "broker/publisher_core.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <utility>

#include "broker/topics.h"
#include "fastcycle/assert.h"

namespace fastcycle::detail {
namespace {

/// The executors to wake once all pushes are done; more than fit are woken at once.
class WakeList {
 public:
  void add(ReadyQueue& queue) noexcept {
    const auto end = queues_.begin() + static_cast<std::ptrdiff_t>(size_);
    if (std::find(queues_.begin(), end, &queue) != end) {
      return;
    }
    if (size_ == queues_.size()) {
      queue.wake();
      return;
    }
    queues_[size_++] = &queue;
  }

  void wake_all() noexcept {
    for (std::size_t i = 0; i < size_; ++i) {
      queues_[i]->wake();
    }
  }

 private:
  std::array<ReadyQueue*, 16> queues_{};
  std::size_t size_ = 0;
};

}  // namespace

PriorityMutex::PriorityMutex() {
  pthread_mutexattr_t attributes;
  pthread_mutexattr_init(&attributes);
  pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
  pthread_mutex_init(&mutex_, &attributes);
  pthread_mutexattr_destroy(&attributes);
}

PriorityMutex::~PriorityMutex() {
  pthread_mutex_destroy(&mutex_);
}
void PriorityMutex::lock() noexcept {
  pthread_mutex_lock(&mutex_);
}
void PriorityMutex::unlock() noexcept {
  pthread_mutex_unlock(&mutex_);
}

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
      forwards_(new Pool(nullptr, topic_.root_count)) {
  if (prototype_ != nullptr) {
    prototype_->CopyFrom(*prototype);
  }
  // One being written, one more that a component may borrow beside it, and what is kept.
  needed_ = 2 + options.keep + options.latched;
  pool_->grow(needed_, prototype_.get());
  provided_ = needed_;
  latched_.reserve(options.latched);
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

std::size_t PublisherCore::pool_limit() const noexcept {
  return options.pool_max != 0 ? options.pool_max : 2 * needed_ + 64;
}

namespace {

/// How many messages a subscription may hold: those that wait, the one in its callback, the kept.
std::size_t held_by(const Lane& lane) noexcept {
  return lane.options.depth + 1 + lane.subscription.keep;
}

}  // namespace

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

void PublisherCore::connect(const std::shared_ptr<Lane>& lane, Inbox& inbox) {
  needed_ += held_by(*lane);
  if (needed_ > provided_) {
    pool_->grow(needed_ - provided_, prototype_.get());
    provided_ = needed_;
  }
  const std::uint64_t bit = lane->options.is_view ? 0 : std::uint64_t{1} << lane->bit;
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
  if (given > 0 && bit != 0 && inbox.mark(bit)) {
    inbox.queue().wake();
  }
}

void PublisherCore::provide_for(const Lane::Options& lane, std::size_t keep) {
  const std::size_t count = lane.depth + 1 + keep;
  pool_->grow(count, prototype_.get());
  provided_ += count;
  targets_.reserve(targets_.size() + 1);
}

void PublisherCore::disconnect(const Lane& lane) noexcept {
  std::erase_if(targets_, [&](const Target& target) {
    if (target.lane.get() != &lane) {
      return false;
    }
    if (lane.credit != nullptr) {
      credits_->remove(lane);
    }
    target.lane->is_left_by_publisher.store(true);
    needed_ -= held_by(lane);
    return true;
  });
}

Envelope* PublisherCore::take_from(Pool& pool, Envelope*& scratch) {
  if (Envelope* envelope = pool.take()) {
    return envelope;
  }
  // In simulated time losses must not depend on how fast the workers are.
  if (pool.size() < pool_limit() || owner.stage != nullptr) {
    pool.grow(1, prototype_.get());
    return pool.take();
  }
  if (scratch == nullptr) {
    pool.grow(1, prototype_.get());
    scratch = pool.take();
    scratch->next = nullptr;
    scratch->is_scratch = true;
  }
  return std::exchange(scratch, scratch->next);
}

Envelope* PublisherCore::loan(bool is_cleared) {
  // What came back last is warm, in caches and in pages; but in a burst its list belongs to the
  // readers. An external publisher is in no activation, and may not look at its owner's.
  if (owner.stage == nullptr && (options.is_external || owner.publish_count == 0)) {
    pool_->collect();
  }
  Envelope* envelope = take_from(*pool_, scratch_loans_);
  __builtin_prefetch(&envelope->info, 1);
  if (is_cleared) {
    envelope->own->Clear();
  }
  return envelope;
}

void PublisherCore::return_loan(Envelope* loan) noexcept {
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
  if (envelope.info.sequence == 1) {
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
  if (!owner.is_in_activation || owner.is_muted) [[unlikely]] {
    drop_muted(loan);
    return;
  }
  FASTCYCLE_ASSERT(!options_.taken_at || !owner.has_subscribers,
                   "taken_at is for components without subscribers: others inherit it");
  Origin origin = *owner.origin;
  if (options_.taken_at || origin.root == 0) {
    origin = {.taken = options_.taken_at.value_or(owner.now), .root = id};
  }
  if (owner.publish_count++ == 0) {
    prepare();
  }
  loan->payload = loan->own;
  const bool is_simulated = owner.stage != nullptr;
  number(*loan, origin, is_simulated ? owner.now + owner.simulated_cost : owner.clock->now());
  owner.published = loan->info.publish_time;
  if (root_count != 0) [[unlikely]] {
    follow(*loan, owner.trails, owner.held_trails);
  }
  send(loan, owner.stage);
}

void PublisherCore::forward(Envelope* received) {
  if (!owner.is_in_activation || owner.is_muted) [[unlikely]] {
    drop_muted(nullptr);
    return;
  }
  if (owner.publish_count++ == 0) {
    prepare();
  }
  if (forwards_->size() == 0) {
    forwards_->grow(needed_);
  }
  Envelope* envelope = take_from(*forwards_, scratch_forwards_);
  Envelope* foreign = received->foreign != nullptr ? received->foreign : received;
  retain(*foreign);
  envelope->foreign = foreign;
  envelope->payload = foreign->payload;
  Origin origin = *owner.origin;
  const bool is_forwarded_alone = origin.root == 0;  // Nothing that was delivered led here.
  if (is_forwarded_alone) {
    origin = received->info.origin;
  }
  const bool is_simulated = owner.stage != nullptr;
  number(*envelope, origin, is_simulated ? owner.now + owner.simulated_cost : owner.clock->now());
  owner.published = envelope->info.publish_time;
  if (root_count != 0) [[unlikely]] {
    follow(*envelope, is_forwarded_alone ? received->trails : owner.trails, owner.held_trails);
  }
  send(envelope, owner.stage);
}

void PublisherCore::publish_external(Envelope* loan, Time taken_at) {
  const std::lock_guard lock(mutex_);
  if (is_external_muted_) {
    muted_.add();
    return_loan(loan);
    return;
  }
  loan->payload = loan->own;
  number(*loan, {.taken = taken_at, .root = id}, owner.clock->now());
  if (root_count != 0) [[unlikely]] {
    follow(*loan, nullptr, nullptr);
  }
  if (is_open_) {
    send(loan, external_stage_);
  } else {
    drop_outside(loan);
  }
}

void PublisherCore::publish_again(Envelope* loan, const MessageInfo& info) {
  const std::lock_guard lock(mutex_);
  published_.add();
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
    deliver(loan);
  } else {
    drop_outside(loan);
  }
}

void PublisherCore::drop_outside(Envelope* loan) noexcept {
  // Before the start and after the stop nobody is served.
  ++handed_over_;
  for (const Target& target : targets_) {
    target.lane->published.add();
    target.lane->dropped_outside.add();
  }
  return_loan(loan);
}

void PublisherCore::drop_muted(Envelope* loan) noexcept {
  FASTCYCLE_ASSERT(owner.is_in_activation, "a component publishes only inside its callbacks");
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
  if (Envelope* foreign = std::exchange(scratch->foreign, nullptr)) {
    release(foreign);
  }
  scratch->next = std::exchange(list, scratch);
}

void PublisherCore::deliver(Envelope* envelope) noexcept {
  if (owner.stage != nullptr) {
    pool_->collect();
    forwards_->collect();
    ++handed_over_;
  }
  if (envelope->is_scratch) {
    drop_scratch(envelope);
    return;
  }
  const std::size_t count = targets_.size() + (options.latched > 0 ? 1 : 0);
  if (count == 0) {
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
    if (Envelope* displaced = lane.push(envelope)) {
      release(displaced);
      if (topic.overflow_watch != nullptr && !lane.options.is_view) {
        topic.overflow_watch->overflowed(lane.subscription);
      }
    }
    if (target.bit != 0 && target.inbox->mark(target.bit)) {
      wakes.add(target.inbox->queue());
    }
    if (lane.is_closed()) {
      lane.dropped_after_close.add(lane.drain());
    }
  }
  wakes.wake_all();
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
  FASTCYCLE_ASSERT(credits_ != nullptr, "a publisher that is asked for credits has some");
  FASTCYCLE_ASSERT(owner.is_in_activation, "a component asks for credits inside its callbacks");
  if (owner.is_muted) {
    return 0;  // What it publishes reaches nobody, and comes back from nobody.
  }
  if (!is_asked_) {
    is_asked_ = true;
    granted_ = credits_->left(staged());
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
  if (credits_->left(staged()) == 0) {
    credits_->await();
    return false;
  }
  return true;
}

std::size_t PublisherCore::ask_external_credits() {
  FASTCYCLE_ASSERT(credits_ != nullptr, "a publisher that is asked for credits has some");
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
  FASTCYCLE_ASSERT(credits_ != nullptr, "a publisher that is asked for credits has some");
  const std::stop_callback wake_up(stop, [this] { credits_->wake(); });
  while (!stop.stop_requested()) {
    const std::uint32_t epoch = credits_->epoch();
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
  return false;
}

Envelope* take_loan(PublisherCore& publisher, bool cleared) {
  return publisher.loan(cleared);
}

void return_loan(PublisherCore& publisher, Envelope* loan) noexcept {
  publisher.return_loan(loan);
}

void publish_loan(PublisherCore& publisher, Envelope* loan, const PublishOptions& options) {
  publisher.publish(loan, options);
}

void publish_received(PublisherCore& publisher, Envelope* received) {
  publisher.forward(received);
}

Envelope* take_external_loan(PublisherCore& publisher, bool cleared) {
  const std::lock_guard lock(publisher.mutex());
  return publisher.loan(cleared);
}

void return_external_loan(PublisherCore& publisher, Envelope* loan) noexcept {
  const std::lock_guard lock(publisher.mutex());
  publisher.return_loan(loan);
}

std::size_t ask_credits(PublisherCore& publisher) {
  return publisher.ask_credits();
}

std::size_t ask_external_credits(PublisherCore& publisher) {
  return publisher.ask_external_credits();
}

bool wait_for_credit(PublisherCore& publisher, const std::stop_token& stop) {
  return publisher.wait_for_credit(stop);
}

void publish_external(PublisherCore& publisher, Envelope* loan, Time taken_at) {
  publisher.publish_external(loan, taken_at);
}

}  // namespace fastcycle::detail
