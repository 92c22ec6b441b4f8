#pragma once

#include <functional>
#include <vector>

#include "broker/publishing_component.h"

namespace fastcycle::detail {

/// What one component published and asked for in a round of simulated time, in its order, until the
/// round is over.
///
/// @threads  Confined to the component's activations, and to who runs the rounds, between them.
class RoundStage final : public Stage {
 public:
  void put(PublisherCore& publisher, Envelope* envelope) override {
    staged_.push_back({.publisher = &publisher, .envelope = envelope});
  }
  /// `action` is done when the round is over.
  void put(std::function<void()> action) { staged_.push_back({.action = std::move(action)}); }

  [[nodiscard]] bool is_empty() const noexcept { return staged_.empty(); }

  /// The round is over. What is put meanwhile waits for the end of the next one.
  void hand_over();

 private:
  /// A message, or something else to be done.
  struct Staged {
    PublisherCore* publisher = nullptr;
    Envelope* envelope = nullptr;
    std::function<void()> action = {};
  };

  std::vector<Staged> staged_;
  std::vector<Staged> handed_over_;  ///< Keeps its capacity.
};

}  // namespace fastcycle::detail
