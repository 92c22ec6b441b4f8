#pragma once

#include <functional>
#include <vector>

#include "broker/publishing_component.h"

namespace fastcycle::detail {

/// The publishes and requests of one component in a round of simulated time, in order, until the
/// end of the round.
///
/// @threads  Confined to the component's activations, and between them to the thread that runs the
///           rounds.
class RoundStage final : public Stage {
 public:
  void put(PublisherCore& publisher, Envelope* envelope) override {
    staged_.push_back({.publisher = &publisher, .envelope = envelope});
  }
  /// Executes `action` at the end of the round.
  void put(std::function<void()> action) { staged_.push_back({.action = std::move(action)}); }

  [[nodiscard]] bool is_empty() const noexcept { return staged_.empty(); }

  /// Called at the end of the round. Later additions wait for the end of the next one.
  void hand_over();

 private:
  /// A message, or another action.
  struct Staged {
    PublisherCore* publisher = nullptr;
    Envelope* envelope = nullptr;
    std::function<void()> action = {};
  };

  std::vector<Staged> staged_;
  std::vector<Staged> handed_over_;  ///< Keeps its capacity.
};

}  // namespace fastcycle::detail
