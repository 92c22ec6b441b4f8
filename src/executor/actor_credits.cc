#include "executor/actor_credits.h"

#include <utility>

#include "broker/publisher_core.h"

namespace fastcycle::detail {

void ActorCredits::give_back(std::shared_ptr<LaneCredit> credit) {
  if (actor_.clock.is_simulated()) {
    stage_.put([credit = std::move(credit)] { credit->finish(); });
  } else {
    credit->finish();
  }
}

void ActorCredits::finish() {
  if (actor_.clock.is_simulated()) {
    give_back(served_);
  } else {
    served_->finish();
  }
}

void ActorCredits::end(const Subscription& subscription) noexcept {
  for (auto& credit : subscription.credits()) {
    if (actor_.clock.is_simulated() && actor_.publishing.is_in_activation()) {
      stage_.put([credit = std::move(credit)] { credit->end(); });
    } else {
      credit->end();
    }
  }
}

void ActorCredits::finish_asking() {
  for (PublisherCore* publisher : actor_.publishing.asked) {
    if (!publisher->end_asking()) {
      continue;
    }
    if (actor_.clock.is_simulated()) {
      stage_.put([publisher] { publisher->await_credits(); });
    } else {
      publisher->await_credits();
    }
  }
  actor_.publishing.asked.clear();
}

}  // namespace fastcycle::detail
