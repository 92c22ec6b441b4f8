#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "broker/publishing_component.h"
#include "executor/foreign_inputs.h"
#include "processes/activity.h"
#include "processes/process_plan.h"
#include "segment/link_set.h"
#include "segment/wire.h"
#include "standby/follower.h"

namespace fastcycle::processes {

/// Notifies followers of a process that one of its activations has ended.
///
/// @threads  As `ActivationBell`.
class FollowerBell final : public detail::ActivationBell {
 public:
  /// The plan and `wire` must outlive it.
  FollowerBell(const ProcessPlan& plan, const segment::Wire& wire, segment::ProcessIndex process,
               std::uint32_t incarnation)
      : wire_(wire),
        words_(wire.standby(process, incarnation)),
        followers_(plan.followers_of(process)) {}

  void ring() noexcept override;

 private:
  const segment::Wire& wire_;
  segment::StandbyWords& words_;
  const std::vector<segment::ProcessIndex> followers_;
};

/// A process that follows another one: the active or the standby process of a pair, or a shadow.
///
/// @threads  Safe after the build.
class Pair final : public standby::Followed {
 public:
  /// The plan and `wire` must outlive it.
  Pair(const ProcessPlan& plan, const segment::Wire& wire, segment::ProcessIndex process,
       std::uint32_t incarnation);
  ~Pair() override;

  /// The active process of the pair of `process` and `twin`.
  [[nodiscard]] static segment::ProcessIndex active_of(const segment::Wire& wire,
                                                       segment::ProcessIndex process,
                                                       segment::ProcessIndex twin);

  /// If this process is a follower, its components start to follow. Call before the start.
  void begin(host::ApplicationHost& application,
             const std::vector<detail::ComponentCore*>& components,
             std::vector<segment::LinkSet*> links, standby::Follower::Listener listener);
  /// The application stops: no more takeovers.
  void end();

  [[nodiscard]] standby::Follower* follower() const { return follower_.get(); }

  // Called by its workers, which are numbered over all executors.
  void begin_worker(unsigned worker) noexcept;
  void end_worker(unsigned worker) noexcept;
  /// As `ForeignInputs`, for the other process's activity.
  std::size_t announce(std::span<base::WatchedWord> words) noexcept;
  void withdraw() noexcept;

  // As `Followed`.
  [[nodiscard]] const detail::PeerActivity::Rings& rings() const override {
    return activity_.rings(other_incarnation_);
  }
  [[nodiscard]] std::uint32_t progress() const noexcept override {
    return other_words().progress.load(std::memory_order_seq_cst);
  }
  [[nodiscard]] bool has_ended() const noexcept override;
  [[nodiscard]] std::optional<std::uint32_t> crashed_in() const noexcept override;
  void take_rest() override;
  void take_place() override;

 private:
  [[nodiscard]] segment::StandbyWords& other_words() const noexcept {
    return wire_.standby(other_, other_incarnation_);
  }
  /// A futex word that the kernel changes when that worker of the other process ends.
  [[nodiscard]] const std::atomic<std::uint32_t>& life_of_other(unsigned worker) const noexcept;

  const segment::Wire& wire_;
  const segment::ProcessIndex process_;
  const std::uint32_t incarnation_;
  const segment::ProcessIndex other_;
  const unsigned workers_;
  const bool is_shadow_;
  segment::StandbyWords& words_;
  const ActivityOfProcess activity_;
  std::uint32_t other_incarnation_ = 1;
  bool begins_on_standby_ = false;
  std::vector<segment::LinkSet*> links_;
  std::unique_ptr<standby::Follower> follower_;
};

/// Input of an executor of a paired process: messages, and the other process's activity.
///
/// @threads  As `ForeignInputs`.
class PairedInputs final : public detail::ForeignInputs {
 public:
  /// `first_worker`: index of the executor's first worker in the process. The references must
  /// outlive this.
  PairedInputs(segment::LinkSet& links, Pair& pair, unsigned first_worker)
      : links_(links), pair_(pair), first_worker_(first_worker) {}

  void begin_worker(unsigned worker) noexcept override {
    pair_.begin_worker(first_worker_ + worker);
  }
  void end_worker(unsigned worker) noexcept override { pair_.end_worker(first_worker_ + worker); }
  bool take() noexcept override {
    const bool has_come = links_.take();
    standby::Follower* const follower = pair_.follower();
    return follower == nullptr ? has_come : follower->look(has_come);
  }
  std::size_t announce(std::span<base::WatchedWord> words) noexcept override {
    const std::size_t count = links_.announce(words);
    return count + pair_.announce(words.subspan(count));
  }
  [[nodiscard]] bool has_any() noexcept override {
    const standby::Follower* const follower = pair_.follower();
    return links_.has_any() || (follower != nullptr && follower->has_news());
  }
  void withdraw() noexcept override {
    links_.withdraw();
    pair_.withdraw();
  }

 private:
  segment::LinkSet& links_;
  Pair& pair_;
  const unsigned first_worker_;
};

}  // namespace fastcycle::processes
