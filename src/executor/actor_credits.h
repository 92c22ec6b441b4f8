#pragma once

#include <memory>

#include "broker/credits.h"
#include "broker/subscription.h"
#include "executor/actor_base.h"
#include "executor/round_stage.h"

namespace fastcycle::detail {

/// The credits that one component returns and waits for; in simulated time at the end of the round.
///
/// @threads  As `Actor`.
class ActorCredits {
 public:
  ActorCredits(ActorBase& actor, RoundStage& stage) : actor_(actor), stage_(stage) {}
  ActorCredits(const ActorCredits&) = delete;
  ActorCredits& operator=(const ActorCredits&) = delete;

  /// It has finished a message.
  void give_back(std::shared_ptr<LaneCredit> credit);
  /// It begins to serve a message of a lane with this credit, which its callback may end.
  void begin(const std::shared_ptr<LaneCredit>& credit) {
    if (served_ != credit) {  // In a burst it is the same again, and nothing is counted.
      served_ = credit;
    }
  }
  /// It has finished the message of `begin`.
  void finish();
  /// It takes nothing more of `subscription`: returns all its credits.
  void end(const Subscription& subscription) noexcept;
  /// At the end of an activation: waits for the credits of publishers that were queried and used
  /// up.
  void finish_asking();

 private:
  ActorBase& actor_;
  RoundStage& stage_;
  std::shared_ptr<LaneCredit> served_;  ///< Of the message that is served now, or was last.
};

}  // namespace fastcycle::detail
