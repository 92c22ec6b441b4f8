#pragma once

#include "fastcycle/message.h"

namespace fastcycle {

/// Component state that FastCycle preserves: a message that the component reads and writes, and
/// that outlives its object.
///
///     class Filter final : public fastcycle::Component {
///      public:
///       explicit Filter(fastcycle::Context& context)
///           : Component(context), estimate_(context.state<demo::Estimate>("estimate")) { … }
///      private:
///       void on_fix(const demo::Fix& fix) { estimate_->set_x_m(fix.x_m()); }
///       fastcycle::State<demo::Estimate> estimate_;
///     };
///
/// It is empty at first. When the object is constructed again, after a fault or at the request of a
/// tool, its constructor finds the state that the previous object left, including partial changes
/// of a callback that threw. While the run is recorded, *key frames* of it are written every
/// `"state_period_s"`; `fastcycle verify` can begin at one of them, in the middle of a log, if all
/// that the component keeps between callbacks is declared. docs/reference/state.md
///
/// Copies are the same state.
///
/// @threads  Confined to the component's constructor and callbacks.
template <Message T>
class State {
 public:
  /// Constructed by `Context::state`.
  explicit State(T& value) : value_(&value) {}

  [[nodiscard]] T& operator*() const noexcept { return *value_; }  ///< The message.
  [[nodiscard]] T* operator->() const noexcept { return value_; }  ///< As `*`.

 private:
  T* value_;
};

}  // namespace fastcycle
