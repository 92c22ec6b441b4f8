#include "standby/follower.h"

#include <algorithm>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/clock.h"
#include "broker/publisher_core.h"
#include "broker/topic.h"
#include "record/serializer.h"
#include "replay/message_difference.h"

namespace fastcycle::standby {

namespace {

/// Limit of known and not executed activations; beyond it is too far behind.
constexpr std::uint64_t kMostBehind = 4096;

/// Writes into neither; protobuf's own functions would, into one of another process.
bool are_equal(const google::protobuf::Message& one, const google::protobuf::Message& other) {
  record::Serializer serializer;
  return serializer.serialize_to_string(one) == serializer.serialize_to_string(other);
}

}  // namespace

Follower::Follower(host::ApplicationHost& application, Followed& followed,
                   const std::vector<detail::ComponentCore*>& components, Options options,
                   Listener listener)
    : followed_(followed), options_(options), listener_(std::move(listener)) {
  const bool is_late = options.is_late;
  const detail::PeerActivity::Rings& rings = followed.rings();
  for (detail::ComponentCore* core : components) {
    Its& its = its_[core->index];
    its.reads = std::make_unique<ReadAssembly>(*rings.reads[core->index]);
    its.is_late = is_late;
    its.script = std::make_unique<FollowedComponent>(
        *core, *this,
        FollowedComponent::Listener{.found_frame = [this] { still_seeking_.fetch_sub(1); },
                                    .lost = [this](const std::string& why) { lose(why); },
                                    .taken_over = [this] { component_is_over(); }},
        is_late ? &application : nullptr);
  }
  still_following_ = components.size();
  still_seeking_ = is_late ? components.size() : 0;
  for (const detail::ActivationRing* ring : rings.workers) {
    next_.push_back(is_late ? ring->size() : 0);
  }
  begins_after_ns_ = is_late ? base::monotonic_ns() : 0;
}

Follower::~Follower() = default;

bool Follower::has_news() const noexcept {
  return !is_over_.load() && !is_lost_.load() &&
         (followed_.progress() != progress_seen_.load() ||
          (!is_taking_over_.load() && followed_.has_ended()));
}

bool Follower::look(bool has_come) {
  if (is_over_.load() || is_lost_.load()) {
    return has_come;
  }
  const std::lock_guard lock(mutex_);
  bool is_anything_new = has_come;
  // Before the rings: activations that end later cause another pass.
  if (const std::uint32_t progress = followed_.progress();
      progress != progress_seen_.exchange(progress)) {
    read_rings();
    is_anything_new = true;
  }
  if (!is_taking_over_.load() && followed_.has_ended()) {
    take_over();
    is_anything_new = true;
  }
  if (is_anything_new) {
    mark_all();
  }
  return is_anything_new;
}

/// With the mutex held.
void Follower::read_rings() {
  const auto& rings = followed_.rings().workers;
  new_.clear();
  bool is_anything_lost = false;
  for (std::size_t i = 0; i < rings.size(); ++i) {
    is_anything_lost = rings[i]->read(next_[i], new_) > 0 || is_anything_lost;
  }
  for (auto& [index, its] : its_) {
    is_anything_lost = (!its.reads->read() && !its.is_late) || is_anything_lost;
  }
  for (const detail::ActivationRecord& record : new_) {
    add(record);
  }
  for (auto& [index, its] : its_) {
    pass_on(its);
  }
  if (still_seeking_.load() == 0 && known_ > 0 && !std::exchange(is_in_step_, true)) {
    listener_.in_step();
  }
  if (is_anything_lost) {
    lose("it is so far behind that activations were written over");
  }
}

void Follower::add(const detail::ActivationRecord& record) {
  const auto its = its_.find(record.component);
  if (its != its_.end() && (its->second.is_late ? record.begin_ns > begins_after_ns_
                                                : record.number >= its->second.next)) {
    its->second.pending.emplace(record.number, record);
  }
}

/// Passes consecutive activations to the script.
void Follower::pass_on(Its& its) {
  while (!its.pending.empty()) {
    const auto first = its.pending.begin();
    if (its.is_late) {  // The script searches for a key frame, from the first known activation on.
      its.is_late = false;
      its.next = first->first;
    }
    if (first->first != its.next) {
      return;
    }
    its.script->add({.record = first->second, .reads = its.reads->take(first->first)});
    its.pending.erase(first);
    ++its.next;
    ++known_;
  }
  if (its.next - 1 > its.script->executed() + kMostBehind && its.script->executed() > 0) {
    lose(fmt::format("it is more than {} activations behind", kMostBehind));
  }
}

/// With the mutex held.
void Follower::take_over() {
  if (!options_.takes_over) {
    lose("the process that it follows has ended");
    return;
  }
  if (still_seeking_.load() > 0) {
    lose("the other one ended before there was a key frame of all components to begin at");
    return;
  }
  ended_ns_ = base::monotonic_ns();
  is_taking_over_ = true;
  followed_.take_rest();
  read_rings();
  // Those in which it ended. Some receivers may have what they published. One in which the
  // component crashed would crash here too: it is skipped.
  const std::optional<std::uint32_t> crashed = followed_.crashed_in();
  const auto& rings = followed_.rings().workers;
  for (std::size_t i = 0; i < rings.size(); ++i) {
    detail::ActivationRecord record;
    if (next_[i] >= rings[i]->size() || !rings[i]->read_at(next_[i], record)) {
      continue;
    }
    add(record);
    if (const auto its = its_.find(record.component);
        its != its_.end() && record.component == crashed) {
      its->second.script->leave_out(record.number);
    }
  }
  followed_.take_place();
  for (auto& [index, its] : its_) {
    pass_on(its);
    its.script->take_over();
  }
}

void Follower::mark_all() {
  for (auto& [index, its] : its_) {
    its.script->mark();
    its.script->wake();
  }
}

void Follower::lose(const std::string& why) {
  if (!is_lost_.exchange(true) && !is_taking_over_.load()) {
    listener_.lost(why);
  }
}

void Follower::component_is_over() {
  if (still_following_.fetch_sub(1) == 1) {
    is_over_ = true;
    listener_.taken_over(base::monotonic_ns() - ended_ns_);
  }
}

void Follower::end() {
  is_over_ = true;
  for (auto& [index, its] : its_) {
    its.script->end();
  }
}

Follower::Progress Follower::progress() const {
  const std::lock_guard lock(mutex_);
  Progress progress{.known = known_, .executed = 0, .compared = compared_.load()};
  for (const auto& [index, its] : its_) {
    progress.executed += its.script->executed();
  }
  return progress;
}

void Follower::unmatched(const detail::PublisherCore& publisher, bool is_theirs) noexcept {
  if (listener_.unmatched) {
    listener_.unmatched(publisher, is_theirs);
  }
}

void Follower::not_compared(const detail::PublisherCore& publisher) noexcept {
  if (listener_.not_compared) {
    listener_.not_compared(publisher);
  }
}

void Follower::compare(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
                       const detail::Envelope& own) noexcept {
  compared_.fetch_add(1, std::memory_order_relaxed);
  const bool is_equal = are_equal(*theirs.payload, *own.payload);
  if (listener_.compare) {
    listener_.compare(publisher, theirs, own, is_equal);
    return;
  }
  if (is_equal) {
    return;
  }
  std::string first;
  host::for_each_difference(*theirs.payload, *own.payload, [&](const auto& difference) {
    if (first.empty()) {
      first = fmt::format("field {} is {} there and {} here", difference.path(),
                          difference.recorded(), difference.now());
    }
  });
  if (!first.empty()) {
    lose(fmt::format("message {} of \"{}\" differs: {}", own.info.sequence, publisher.topic.name,
                     first));
  }
}

}  // namespace fastcycle::standby
