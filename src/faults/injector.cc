#include "faults/injector.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "broker/publisher_core.h"
#include "broker/subscription.h"
#include "config/nearest.h"

namespace fastcycle::faults {

using config::FaultDescription;
using config::FaultKind;

Injector::Injector(const config::FaultsDescription& faults, const base::Clock& clock)
    : clock_(clock) {
  gate_clock_.seed = faults.seed;
  for (const FaultDescription& fault : faults.list) {
    faults_.emplace_back(fault);
  }
}

Injector::~Injector() {
  end();
}

/// Checks the ends and fields of a fault whose topic exists.
void Injector::check(const ActiveFault& fault, const detail::Topics& topics,
                     config::Problems& problems) const {
  const FaultDescription& its = fault.description;
  const auto add = [&](std::string message, std::string hint = {}) {
    problems.add(config::make_error(
        its.place, fmt::format("the fault \"{}\": {}", its.name, message), std::move(hint)));
  };
  const detail::Topic* const topic = topics.find(its.topic);
  if (topic == nullptr || topic->type.empty()) {
    std::vector<std::string> names;
    for (const auto& [name, one] : topics.all()) {
      if (!one->type.empty()) {
        names.push_back(name);
      }
    }
    add(fmt::format("no component publishes or subscribes to \"{}\"", its.topic),
        config::did_you_mean(config::nearest(its.topic, names)));
    return;
  }
  const auto publishes = [&](const auto& one) { return one->owner.name == its.publisher; };
  if (!its.publisher.empty() && std::ranges::none_of(topic->publishers, publishes)) {
    add(fmt::format("\"{}\" does not publish on \"{}\"", its.publisher, its.topic));
  }
  const auto subscribes = [&](const auto& one) { return one->component == its.subscriber; };
  if (!its.subscriber.empty() && std::ranges::none_of(topic->subscriptions, subscribes)) {
    add(fmt::format("\"{}\" does not subscribe to \"{}\"", its.subscriber, its.topic));
  }
  if (its.kind == FaultKind::kCorrupt && !topic->publishers.empty()) {
    std::string why;
    const auto* type = topic->publishers.front()->default_instance.GetDescriptor();
    if (!FieldPath::find(its.field, *type, its.corruption, why)) {
      add(fmt::format("the field \"{}\" of \"{}\" cannot be corrupted: {}", its.field, its.topic,
                      why));
    }
  }
}

void Injector::attach(detail::Topics& topics, bool is_whole, config::Problems& problems) {
  if (is_whole) {
    for (const ActiveFault& fault : faults_) {
      if (config::is_of_topic(fault.description.kind)) {
        check(fault, topics, problems);
      }
    }
  }
  for (const auto& [name, topic] : topics.all()) {
    for (const auto& publisher : topic->publishers) {
      std::vector<Gate::Part> parts;
      for (ActiveFault& fault : faults_) {
        const FaultDescription& its = fault.description;
        if (!config::is_of_topic(its.kind) || its.topic != name ||
            (!its.publisher.empty() && its.publisher != publisher->owner.name)) {
          continue;
        }
        std::string why;
        auto field = its.kind == FaultKind::kCorrupt
                         ? FieldPath::find(its.field, *publisher->default_instance.GetDescriptor(),
                                           its.corruption, why)
                         : std::nullopt;
        if (why.empty()) {
          parts.push_back({&fault, std::move(field)});
        }
      }
      if (!parts.empty()) {
        gates_.push_back(std::make_unique<Gate>(*publisher, std::move(parts), gate_clock_));
        publisher->set_gate(gates_.back().get());
        gated_.push_back(publisher.get());
      }
    }
  }
}

void Injector::begin(Time start, std::vector<base::Refusal>& refusals) {
  const Time now = clock_.now();
  for (ActiveFault& fault : faults_) {
    const FaultDescription& its = fault.description;
    if (config::is_of_topic(its.kind)) {
      continue;
    }
    const Time begin = start + its.from;
    const bool lasts = its.kind == FaultKind::kSlow && (!its.to || start + *its.to > now);
    if (start < now && begin <= now && !lasts) {
      continue;
    }
    strikes_.push_back({begin, &fault, false});
    if (its.to) {
      strikes_.push_back({start + *its.to, &fault, true});
    }
  }
  // Those of one time in the order of the file.
  std::ranges::sort(strikes_, {}, [](const Strike& its) {
    return std::tuple(its.time, &its.fault->description, its.is_over);
  });
  gate_clock_.begin_ns.store(base::to_ns(start));
  if (clock_.is_simulated()) {
    return;
  }
  gate_clock_.held = [this] {
    changes_.fetch_add(1);
    sleepers_.wake(0);
  };
  base::ThreadOptions options;
  options.name = "fc-faults";
  thread_ = base::Thread(options, [this] { run_live(); }, refusals);
}

void Injector::end() {
  if (is_stopping_.exchange(true)) {
    return;
  }
  gate_clock_.end_ns.store(base::to_ns(clock_.now()));
  sleepers_.wake(0);
  thread_.join();
  strikes_.clear();
  for (const auto& gate : gates_) {
    gate->give_up();
  }
}

std::vector<FaultCount> Injector::counts() const {
  std::vector<FaultCount> counts;
  for (const ActiveFault& fault : faults_) {
    const FaultDescription& its = fault.description;
    counts.push_back({its.name, its.kind, its.topic + its.component + its.process,  // It has one.
                      fault.count.load(std::memory_order_relaxed), fault.messages});
    std::ranges::sort(counts.back().messages);
  }
  return counts;
}

std::string Injector::summary() const {
  std::string names;
  constexpr std::size_t kMostNamed = 8;
  for (std::size_t i = 0; i < std::min(faults_.size(), kMostNamed); ++i) {
    names += (i == 0 ? "" : ", ") + faults_[i].description.name;
  }
  if (faults_.size() > kMostNamed) {
    names += ", ...";
  }
  return fmt::format("faults are injected into this run: {} ({}), seed {}", faults_.size(), names,
                     gate_clock_.seed);
}

std::int64_t Injector::own_due_ns() const noexcept {
  std::int64_t due_ns = strikes_.empty() ? base::kNever : base::to_ns(strikes_.front().time);
  for (const auto& gate : gates_) {
    due_ns = std::min(due_ns, gate->next_due_ns());
  }
  return due_ns;
}

std::int64_t Injector::next_due_ns() const noexcept {
  return std::min(own_due_ns(), other_ == nullptr ? base::kNever : other_->next_due_ns());
}

std::uint32_t Injector::next_step() const noexcept {
  return other_ == nullptr || own_due_ns() <= other_->next_due_ns() ? 0 : other_->next_step();
}

void Injector::put(Time now, std::uint32_t step) {
  put_due(now);
  if (other_ != nullptr &&
      (other_->next_due_ns() < base::to_ns(now) ||
       (other_->next_due_ns() == base::to_ns(now) && other_->next_step() <= step))) {
    other_->put(now, step);
  }
}

void Injector::put_due(Time now) {
  while (!strikes_.empty() && strikes_.front().time <= now) {
    const Strike next = strikes_.front();
    strikes_.pop_front();
    if (!next.is_over) {
      next.fault->count.fetch_add(1, std::memory_order_relaxed);
    }
    strike(next.fault->description, next.is_over);
  }
  for (const auto& gate : gates_) {
    gate->put_due(now);
  }
}

void Injector::run_live() {
  while (!is_stopping_) {
    const std::uint64_t seen = changes_.load();
    put_due(clock_.now());
    const std::int64_t due_ns = own_due_ns();
    const std::int64_t wake_ns =
        due_ns == base::kNever ? base::kNever : clock_.monotonic_at(base::from_ns(due_ns));
    sleepers_.announce(0);
    if (is_stopping_ || changes_.load() != seen) {
      sleepers_.withdraw(0);
    } else {
      static_cast<void>(sleepers_.sleep(0, wake_ns));
    }
  }
}

}  // namespace fastcycle::faults
