#pragma once

#include <memory>

#include "broker/credits.h"
#include "broker/subscription.h"
#include "executor/actor_base.h"
#include "executor/round_stage.h"

namespace fastcycle::detail {

/// The credits that one component gives back and waits for; in simulated time when the round is
/// over.
///
/// @threads  As `Actor`.
class ActorCredits {
 public:
  ActorCredits(ActorBase& actor, RoundStage& stage) : actor_(actor), stage_(stage) {}
  ActorCredits(const ActorCredits&) = delete;
  ActorCredits& operator=(const ActorCredits&) = delete;

  /// It is done with a message.
  void give_back(std::shared_ptr<LaneCredit> credit);
  /// It serves a message of a lane with this credit, which that callback may end.
  void begin(const std::shared_ptr<LaneCredit>& credit) {
    if (served_ != credit) {  // In a burst it is the same again, and nothing is counted.
      served_ = credit;
    }
  }
  /// It is done with the message that it began with.
  void finish();
  /// It takes nothing more of `subscription`: all its credits are given back.
  void end(const Subscription& subscription) noexcept;
  /// An activation is over: waits for the credits of the publishers that it asked for some, and
  /// used up.
  void finish_asking();

 private:
  ActorBase& actor_;
  RoundStage& stage_;
  std::shared_ptr<LaneCredit> served_;  ///< Of the message that is served now, or was last.
};

}  // namespace fastcycle::detail
