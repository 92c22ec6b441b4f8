#include "reference_system/node.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace fastcycle::benchmark {

std::int64_t count_primes(std::int64_t limit) noexcept {
  std::int64_t primes = 0;
  for (std::int64_t number = 2; number <= limit; ++number) {
    std::int64_t divisor = 2;
    while (divisor < number && number % divisor != 0) {
      ++divisor;
    }
    primes += divisor == number ? 1 : 0;
  }
  return primes;
}

std::int64_t ReferenceInput::merge_into(ReferenceSample& to) {
  if (!newest_) {
    return 0;
  }
  const ReferenceSample& from = **newest_;
  const int known = to.steps_size();
  for (const ReferenceStep& step : from.steps()) {
    const auto begin = to.steps().begin();
    const bool is_known = std::any_of(begin, begin + known, [&](const ReferenceStep& other) {
      return other.node() == step.node();
    });
    if (!is_known && to.steps_size() < kStepsMax) {
      *to.add_steps() = step;
    }
  }
  const std::int64_t sequence = from.steps().rbegin()->sequence();
  const std::int64_t missed = std::max<std::int64_t>(0, sequence - sequence_ - 1);
  sequence_ = sequence;
  newest_.reset();
  return missed;
}

ReferenceOutput::ReferenceOutput(Context& context, std::string_view topic, std::int64_t crunch)
    : node_(context.component_name()),
      publisher_(context.create_publisher<ReferenceSample>(topic)),
      crunch_(crunch) {}

void ReferenceOutput::publish(std::span<ReferenceInput* const> inputs, std::int64_t begin_ns) {
  const std::int64_t primes = count_primes(crunch_);
  auto sample = publisher_.loan();
  std::int64_t missed = 0;
  for (ReferenceInput* const input : inputs) {
    missed += input->merge_into(*sample);
  }
  if (sample->steps_size() < kStepsMax) {
    ReferenceStep& step = *sample->add_steps();
    step.set_node(node_);
    step.set_begin_ns(begin_ns);
    step.set_sequence(++sequence_);
    step.set_missed(missed);
  }
  sample->mutable_data()->resize(kSampleBytes);
  sample->set_primes(primes);
  publisher_.publish(std::move(sample));
}

std::int64_t crunch_param(Context& context, std::string_view name) {
  return context.param<std::int64_t>(name, {.fallback = 0, .min = 0, .max = 1 << 20}).get();
}

Duration phase_param(Context& context) {
  return std::chrono::microseconds(
      context.param<std::int64_t>("phase_us", {.fallback = 0, .min = 0, .unit = "µs"}).get());
}

}  // namespace fastcycle::benchmark
