#include "executor/round_stage.h"

#include "broker/publisher_core.h"

namespace fastcycle::detail {

void RoundStage::hand_over() {
  handed_over_.swap(staged_);
  for (Staged& entry : handed_over_) {
    if (entry.publisher != nullptr) {
      entry.publisher->deliver(entry.envelope);
    } else {
      entry.action();
    }
  }
  handed_over_.clear();
}

}  // namespace fastcycle::detail
