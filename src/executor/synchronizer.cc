#include "executor/synchronizer.h"

#include <utility>

#include "broker/topic.h"

namespace fastcycle::detail {

SynchronizerInput::SynchronizerInput(Topic& its_topic, ActorBase& its_actor,
                                     const SubscriberOptions& queue, Synchronizer& its_synchronizer,
                                     std::size_t its_place)
    : CallbackSubscription(
          its_topic, its_actor, queue,
          [this](Envelope& envelope, const google::protobuf::Message&) {
            synchronizer.take(*this, envelope);
          },
          Kind::kSynchronized),
      synchronizer(its_synchronizer),
      place(its_place) {}

bool SynchronizerInput::add_decided(Ledger& decided) const noexcept {
  decided.delivered += matched.get();
  for (std::size_t reason = 0; reason < dropped.size(); ++reason) {
    decided.dropped[reason] += dropped[reason].get();
  }
  return true;
}

void SynchronizerInput::note_unmatched(const SetMatcher::Departed& departed) noexcept {
  unmatched[static_cast<std::size_t>(departed.why)].add();
  if (departed.why != Unmatched::kTooFar && departed.why != Unmatched::kDepth) {
    return;
  }
  Lack& lack = (departed.why == Unmatched::kTooFar ? too_far : waited)[departed.partner];
  lack.count.add();
  if (departed.difference &&
      departed.difference->count() < lack.smallest_ns.load(std::memory_order_relaxed)) {
    lack.smallest_ns.store(departed.difference->count(), std::memory_order_relaxed);
  }
}

Synchronizer::Synchronizer(ActorBase& actor, HeldOrigins& held, std::size_t topics,
                           const SynchronizerOptions& options, EnvelopeSetCallback callback)
    : actor_(actor),
      held_(held),
      count_(topics),
      options_(options),
      callback_(std::move(callback)),
      matcher_(topics, options),
      trails_(held.root_count()) {}

Synchronizer::~Synchronizer() {
  matcher_.clear();
  for (const SetMatcher::Departed& departed : matcher_.departed()) {
    release(departed.envelope);
  }
}

void Synchronizer::take(const SynchronizerInput& input, Envelope& envelope) {
  retain(envelope);
  const Time time =
      options_.time == SyncTime::kTaken ? envelope.info.origin.taken : envelope.info.publish_time;
  const bool is_complete = matcher_.add(input.place, time, &envelope);
  release_departed(DropReason::kUnmatched);
  if (is_complete) {
    call();
  }
}

void Synchronizer::release_departed(DropReason reason) noexcept {
  for (const SetMatcher::Departed& departed : matcher_.departed()) {
    if (!departed.was_used) {
      inputs_[departed.topic]->dropped[static_cast<std::size_t>(reason)].add();
      if (reason == DropReason::kUnmatched) {
        inputs_[departed.topic]->note_unmatched(departed);
      }
    }
    release(departed.envelope);
  }
}

void Synchronizer::drop_held(DropReason reason) noexcept {
  matcher_.clear();
  release_departed(reason);
}

/// The oldest of a root is that of the set.
void Synchronizer::take_trails(const Envelope& envelope) noexcept {
  for (std::size_t root = 0; root < trails_.size(); ++root) {
    const Trail& trail = envelope.trails[root];
    Trail& oldest = trails_[root];
    if (trail.is_known() && (!oldest.is_known() || trail.taken() < oldest.taken())) {
      oldest = trail;
    }
  }
}

void Synchronizer::call() {
  /// Lets go of the set, also when the callback throws.
  struct Set {
    ~Set() {
      for (std::size_t i = 0; i < count; ++i) {
        if (!members[i].is_held) {
          release(members[i].envelope);
        }
      }
    }
    std::array<SetMatcher::Member, SetMatcher::kMaxTopics> members;
    std::size_t count;
  };
  const Set set{matcher_.set(), count_};
  std::array<SetMember, SetMatcher::kMaxTopics> envelopes{};
  for (Trail& trail : trails_) {
    trail.forget();
  }
  for (std::size_t i = 0; i < count_; ++i) {
    const SetMatcher::Member& member = set.members[i];
    const Origin& origin = member.envelope->info.origin;
    envelopes[i] = {.envelope = member.envelope, .holder = inputs_[i]->holder};
    if (i == 0 || origin.taken < origin_.taken) {
      origin_ = origin;
    }
    const bool ages = inputs_[i]->topic.ages();
    if (ages) {
      take_trails(*member.envelope);
    }
    if (member.is_new) {
      inputs_[i]->matched.add();
      if (ages) {
        held_.hold(*inputs_[i], *member.envelope);
      }
    }
  }
  actor_.publishing.origin = &origin_;
  actor_.publishing.trails = trails_.empty() ? nullptr : trails_.data();
  callback_({envelopes.data(), count_});
}

}  // namespace fastcycle::detail
