#pragma once

#include <memory>
#include <vector>

#include "base/priority_mutex.h"
#include "broker/credits.h"
#include "executor/foreign_inputs.h"
#include "segment/export.h"
#include "segment/import.h"
#include "segment/wire.h"

namespace fastcycle::segment {

/// All links that lead to one executor of a process, and those on which its publishers wait for
/// credits.
///
/// @threads  As `ForeignInputs`; `add` before the executor starts.
class LinkSet final : public detail::ForeignInputs {
 public:
  LinkSet(const Wire& wire, ProcessIndex process, std::uint32_t incarnation, unsigned executor);

  Import& add(const LinkPlan& link, detail::PublisherCore& stand_in);
  /// `to` of a publisher with these `credits` returns them.
  void add(detail::Credits& credits, Export& to);
  /// Connects to all present publishers. Before the executor starts, or as `take`.
  void attach();

  /// In simulated time, at the end of a round, before others take it: reports all credits to them.
  void report_finished() noexcept;

  bool take() noexcept override;
  std::size_t announce(std::span<base::WatchedWord> words) noexcept override;
  [[nodiscard]] bool has_any() noexcept override;
  void withdraw() noexcept override;
  /// As `Import::count_rest`, for all.
  void count_rest() noexcept;

 private:
  /// A process with links to this one.
  struct Source {
    ProcessIndex process;
    std::uint32_t incarnation = 0;
  };

  struct Credited {
    detail::Credits* credits;
    Export* to;
  };

  void watch(ProcessIndex process);
  void look_for_publishers();
  bool take_credits() noexcept;

  const Wire& wire_;
  const ProcessIndex process_;
  const std::uint32_t incarnation_;
  const unsigned executor_;
  std::atomic<std::uint32_t>& sleepers_;

  base::PriorityMutex mutex_;
  std::vector<std::unique_ptr<Import>> imports_;
  std::vector<Credited> credited_;
  std::vector<Source> sources_;
  std::uint32_t changes_seen_ = 0;
};

}  // namespace fastcycle::segment
