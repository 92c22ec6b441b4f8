// A middleware used as its documentation describes, for `gateway_latency.py`: one process sends,
// another receives.
//
//     direct_ENGINE send DOMAIN INTERFACE SIZE COUNT INTERVAL_US
//     direct_ENGINE receive DOMAIN INTERFACE FILE
//
// `send` waits for a reader. `receive` runs until its standard input ends, then writes its samples
// to FILE.
#include "gateway/direct.h"

#include <cstdio>
#include <exception>

namespace {

fastcycle::direct::Plan plan_of(const std::vector<std::string>& words) {
  fastcycle::direct::Plan plan;
  plan.is_sender = words.at(0) == "send";
  plan.domain = static_cast<std::uint32_t>(std::stoul(words.at(1)));
  plan.interface = words.at(2);
  if (plan.is_sender) {
    plan.size = std::stoul(words.at(3));
    plan.count = std::stoll(words.at(4));
    plan.interval_us = std::stoll(words.at(5));
  } else {
    plan.file = words.at(3);
  }
  return plan;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const fastcycle::direct::Plan plan = plan_of({argv + 1, argv + argc});
    const fastcycle::measure::Samples samples = run(plan);
    if (!plan.is_sender) {
      const std::string trouble = fastcycle::measure::write_samples(plan.file, samples);
      if (!trouble.empty()) {
        throw std::runtime_error(trouble);
      }
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 1;
  }
}
