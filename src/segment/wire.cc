#include "segment/wire.h"

#include <algorithm>
#include <bit>

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fastcycle::segment {
namespace {

constexpr std::size_t kLine = 64;

std::size_t round_up(std::size_t bytes, std::size_t to) {
  return (bytes + to - 1) / to * to;
}

std::size_t slots_offset() {
  return round_up(sizeof(LinkOut), kLine);
}
std::size_t messages_offset(const LinkPlan& link) {
  return slots_offset() +
         round_up(Wire::slot_count(link) * sizeof(std::atomic<std::uint64_t>), kLine);
}
std::size_t trails_offset(const LinkPlan& link) {
  return messages_offset(link) + round_up(link.capacity * sizeof(WireMessage), kLine);
}
std::size_t returns_offset() {
  return round_up(sizeof(LinkIn), kLine);
}
/// Offset of the stages of components: after sleepers and bells.
std::size_t stages_offset(const WirePlan& plan) {
  return plan.executors * (std::size_t{plan.processes} + 1) * sizeof(Bell);
}

std::size_t rounds_offset(const WirePlan& plan) {
  return round_up(stages_offset(plan) + plan.components * sizeof(std::uint32_t), kLine);
}
std::size_t notices_offset(const WirePlan& plan) {
  return round_up(rounds_offset(plan) + sizeof(RoundWords), kLine);
}
std::size_t snapshot_offset(const WirePlan& plan) {
  return round_up(notices_offset(plan) + sizeof(NoticeWords), kLine);
}

std::size_t standby_offset(const WirePlan& plan) {
  return round_up(snapshot_offset(plan) + sizeof(SnapshotWords), kLine);
}

}  // namespace

void WirePlan::lay_out() {
  const std::size_t begin = standby_offset(*this) + sizeof(StandbyWords);
  std::vector<std::size_t> ends(processes, std::max(begin, (3 * processes + 1) * sizeof(Bell)));
  for (LinkPlan& link : links) {
    link.out_offset = ends[link.from];
    ends[link.from] +=
        trails_offset(link) + round_up(link.capacity * roots * sizeof(detail::Trail), kLine);
    link.in_offset = ends[link.to];
    ends[link.to] += returns_offset() +
                     Segments::kGenerations * Wire::return_count(link) * sizeof(std::uint64_t);
    ends[link.to] = round_up(ends[link.to], kLine);
  }
  ring_offsets.resize(processes);
  for (ProcessIndex process = 0; process < workers.size(); ++process) {
    ring_offsets[process] = ends[process];
    ends[process] += round_up(workers[process] * sizeof(detail::ActivationRing), kLine);
  }
  for (ProcessIndex process = 0; process < workers.size(); ++process) {
    life_offsets.push_back(ends[process]);
    ends[process] += workers[process] * sizeof(WorkerLife);
  }
  for (std::vector<Reads>* const all : {&reads, &reads_on_standby}) {
    for (Reads& its : *all) {
      if (its.process != 0) {
        its.offset = ends[its.process];
        ends[its.process] += round_up(detail::ReadRing::bytes_of(Wire::kReads), kLine);
      }
    }
  }
  constexpr std::size_t kPage = 4096;
  control_bytes = round_up(*std::ranges::max_element(ends), kPage);
}

std::uint32_t Wire::slot_count(const LinkPlan& link) noexcept {
  return std::bit_ceil(link.depth);
}

std::uint32_t Wire::return_count(const LinkPlan& link) noexcept {
  return std::bit_ceil(link.capacity);
}

std::atomic<std::uint64_t>* Wire::slots(const LinkPlan& link,
                                        std::uint32_t incarnation) const noexcept {
  return &at<std::atomic<std::uint64_t>>(link.from, incarnation, link.out_offset + slots_offset());
}

WireMessage* Wire::messages(const LinkPlan& link, std::uint32_t incarnation) const noexcept {
  return &at<WireMessage>(link.from, incarnation, link.out_offset + messages_offset(link));
}

detail::Trail* Wire::trails(const LinkPlan& link, std::uint32_t incarnation) const noexcept {
  return &at<detail::Trail>(link.from, incarnation, link.out_offset + trails_offset(link));
}

std::atomic<std::uint64_t>* Wire::returns(const LinkPlan& link, std::uint32_t incarnation,
                                          std::uint32_t publisher) const noexcept {
  return &at<std::atomic<std::uint64_t>>(link.to, incarnation, link.in_offset + returns_offset()) +
         std::size_t{generation_of(publisher)} * return_count(link);
}

std::atomic<std::uint32_t>& Wire::stage(ProcessIndex process, std::uint32_t incarnation,
                                        std::size_t component) const noexcept {
  return at<std::atomic<std::uint32_t>>(process, incarnation,
                                        stages_offset(plan_) + component * sizeof(std::uint32_t));
}

RoundWords& Wire::rounds(ProcessIndex process, std::uint32_t incarnation) const noexcept {
  return at<RoundWords>(process, incarnation, rounds_offset(plan_));
}

NoticeWords& Wire::notices(ProcessIndex process, std::uint32_t incarnation) const noexcept {
  return at<NoticeWords>(process, incarnation, notices_offset(plan_));
}

SnapshotWords& Wire::snapshot(ProcessIndex process, std::uint32_t incarnation) const noexcept {
  return at<SnapshotWords>(process, incarnation, snapshot_offset(plan_));
}

StandbyWords& Wire::standby(ProcessIndex process, std::uint32_t incarnation) const noexcept {
  return at<StandbyWords>(process, incarnation, standby_offset(plan_));
}

void wake(const std::atomic<std::uint32_t>& word, int count) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE, count, nullptr, nullptr, 0);
}

}  // namespace fastcycle::segment
