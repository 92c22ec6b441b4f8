#pragma once

#include "fastcycle/message.h"

namespace fastcycle {

/// State that a component declares, so that FastCycle can keep it: a message that is the
/// component's to read and to change, and that outlives its object.
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
/// It is empty at first. An object that is made anew, after a fault or because a tool asks for it,
/// finds in its constructor what the object before it left: also what a callback left that threw
/// halfway. While the run is recorded, *key frames* of it are written every `"state_period_s"`;
/// `fastcycle verify` can begin at one of them, in the middle of a log, if all that the component
/// remembers from one callback to the next is declared. docs/reference/state.md
///
/// Copies are the same state.
///
/// @threads  Confined to the component's constructor and callbacks.
template <Message T>
class State {
 public:
  /// Made by `Context::state`.
  explicit State(T& value) : value_(&value) {}

  [[nodiscard]] T& operator*() const noexcept { return *value_; }  ///< The message.
  [[nodiscard]] T* operator->() const noexcept { return value_; }  ///< As `*`.

 private:
  T* value_;
};

}  // namespace fastcycle
