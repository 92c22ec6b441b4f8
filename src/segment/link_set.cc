#include "segment/link_set.h"

#include <algorithm>
#include <mutex>

namespace fastcycle::segment {

LinkSet::LinkSet(const Wire& wire, ProcessIndex process, std::uint32_t incarnation,
                 unsigned executor)
    : wire_(wire),
      process_(process),
      incarnation_(incarnation),
      executor_(executor),
      sleepers_(wire.sleepers(process, incarnation, executor)) {}

Import& LinkSet::add(const LinkPlan& link, detail::PublisherCore& stand_in) {
  imports_.push_back(std::make_unique<Import>(wire_, link, incarnation_, stand_in));
  for (const auto& other : imports_) {
    if (other != imports_.back() && other->stands_for(stand_in)) {
      imports_.back()->pair_with(*other);
    }
  }
  watch(link.from);
  return *imports_.back();
}

void LinkSet::add(detail::Credits& credits, Export& to) {
  credited_.push_back({&credits, &to});
  watch(to.link().to);
}

void LinkSet::watch(ProcessIndex process) {
  if (std::ranges::find(sources_, process, &Source::process) == sources_.end()) {
    sources_.push_back({.process = process});
  }
}

void LinkSet::report_finished() noexcept {
  for (const auto& import : imports_) {
    import->report_finished();
  }
}

void LinkSet::count_rest() noexcept {
  const std::lock_guard lock(mutex_);
  for (const auto& import : imports_) {
    import->count_rest();
  }
}

bool LinkSet::take_credits() noexcept {
  bool has_taken = false;
  for (const Credited& one : credited_) {
    if (wire_.plan().is_simulated) {
      one.to->take_finished();
    }
    has_taken |= one.credits->take_foreign();
  }
  return has_taken;
}

void LinkSet::attach() {
  const std::lock_guard lock(mutex_);
  changes_seen_ = wire_.changes().load(std::memory_order_seq_cst);
  look_for_publishers();
}

void LinkSet::look_for_publishers() {
  for (const auto& import : imports_) {
    import->attach();
  }
  for (Source& source : sources_) {
    source.incarnation = wire_.incarnation(source.process).load(std::memory_order_seq_cst);
  }
}

bool LinkSet::take() noexcept {
  const std::lock_guard lock(mutex_);
  bool has_taken = false;
  if (const std::uint32_t now = wire_.changes().load(std::memory_order_seq_cst);
      now != changes_seen_) {
    changes_seen_ = now;
    look_for_publishers();
    has_taken = true;
  }
  for (const auto& import : imports_) {
    has_taken |= import->take();
  }
  return take_credits() || has_taken;
}

std::size_t LinkSet::announce(std::span<base::WatchedWord> words) noexcept {
  sleepers_.fetch_add(1, std::memory_order_seq_cst);
  const std::lock_guard lock(mutex_);
  words[0] = {.word = &wire_.changes(), .seen = changes_seen_};
  std::size_t count = 1;
  for (const Source& source : sources_) {
    if (source.incarnation != 0 && count < words.size()) {
      const auto& bell = wire_.bell(source.process, source.incarnation, process_, executor_);
      words[count++] = {.word = &bell, .seen = bell.load(std::memory_order_seq_cst)};
    }
  }
  return count;
}

bool LinkSet::has_any() noexcept {
  const std::lock_guard lock(mutex_);
  return wire_.changes().load(std::memory_order_seq_cst) != changes_seen_ ||
         std::ranges::any_of(imports_, [](const auto& import) { return import->has_any(); }) ||
         std::ranges::any_of(credited_, [](const auto& one) { return one.credits->has_foreign(); });
}

void LinkSet::withdraw() noexcept {
  sleepers_.fetch_sub(1, std::memory_order_seq_cst);
}

}  // namespace fastcycle::segment
