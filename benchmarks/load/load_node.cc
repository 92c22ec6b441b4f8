#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "benchmark/load.pb.h"
#include "measure/clock.h"

namespace fastcycle::benchmark {
namespace {

using Numbers = std::vector<std::int64_t>;

/// Uses the CPU for so long, whatever else runs.
void compute(std::int64_t duration_ns) noexcept {
  if (duration_ns <= 0) {
    return;
  }
  const auto used_ns = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
  };
  const std::int64_t end_ns = used_ns() + duration_ns;
  while (used_ns() < end_ns) {
  }
}

/// A node of a load: timers and inputs, each with a time that it computes, and what it publishes
/// then. load.py makes the parameters.
class LoadNode final : public Component {
 public:
  explicit LoadNode(Context& context)
      : Component(context),
        file_(context.param<Path>("samples", {.fallback = Path()})),
        computes_ns_(numbers("computes_ns")),
        ends_(numbers("ends")) {
    const Numbers periods_us = numbers("periods_us");
    const Numbers phases_us = numbers("phases_us");
    const auto inputs = context.param<std::int64_t>("inputs", {.fallback = 0, .min = 0}).get();
    const auto reads = context.param<std::int64_t>("reads", {.fallback = 0, .min = 0}).get();
    const auto chains = context.param<std::int64_t>("chains", {.fallback = 0, .min = 0}).get();
    roots_ns_.resize(static_cast<std::size_t>(chains));
    ended_ns_.resize(roots_ns_.size());
    const Numbers bytes = numbers("bytes");
    const Numbers causes = numbers("causes");
    const Numbers begins = numbers("begins");
    const Numbers each = numbers("each");
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      outputs_.push_back(
          {.publisher = context.create_publisher<LoadSample>("out_" + std::to_string(i)),
           .bytes = static_cast<std::size_t>(bytes[i]),
           .cause = static_cast<std::size_t>(causes.at(i)),
           .each = each.at(i),
           .begins = begins.at(i)});
    }
    for (std::int64_t i = 0; i < reads; ++i) {
      reads_.push_back(context.create_latest<LoadSample>("read_" + std::to_string(i)));
    }
    std::size_t cause = 0;
    for (; cause < periods_us.size(); ++cause) {
      context.create_timer({.period = std::chrono::microseconds(periods_us[cause]),
                            .phase = std::chrono::microseconds(phases_us.at(cause))},
                           [this, cause] { work(cause); });
    }
    for (std::int64_t i = 0; i < inputs; ++i, ++cause) {
      context.create_subscriber<LoadSample>(
          "in_" + std::to_string(i),
          [this, cause](const LoadSample& sample) { take(cause, sample); });
    }
  }

  void stop() override {
    if (file_.get().empty()) {
      return;
    }
    std::ofstream out(file_.get());
    for (const auto& [chain, latency_ns] : samples_) {
      out << chain << ' ' << latency_ns << '\n';
    }
    if (!out.flush()) {
      throw std::runtime_error("cannot write " + file_.get().string());
    }
  }

 private:
  struct Output {
    Publisher<LoadSample> publisher;
    std::size_t bytes = 0;
    std::size_t cause = 0;     ///< The timer or input after whose work it is published.
    std::int64_t each = 1;     ///< Only after each so many.
    std::int64_t begins = -1;  ///< The chain that begins with it, or -1.
    std::int64_t count = 0;
  };

  Numbers numbers(const char* name) {
    return context().param<Numbers>(name, {.fallback = Numbers()}).get();
  }

  void take(std::size_t cause, const LoadSample& sample) {
    const std::int64_t now_ns = measure::now_ns();
    // `ends_` has pairs: a timer or input, and a chain that ends there.
    for (std::size_t i = 0; i + 1 < ends_.size(); i += 2) {
      const auto chain = static_cast<int>(ends_[i + 1]);
      if (ends_[i] != static_cast<std::int64_t>(cause) || chain >= sample.root_ns_size()) {
        continue;
      }
      // The first message that depends on a root counts.
      std::int64_t& last_ns = ended_ns_.at(static_cast<std::size_t>(chain));
      if (sample.root_ns(chain) > last_ns) {
        last_ns = sample.root_ns(chain);
        samples_.emplace_back(chain, now_ns - last_ns);
      }
    }
    merge(sample);
    work(cause);
  }

  void merge(const LoadSample& sample) {
    const std::size_t count =
        std::min(roots_ns_.size(), static_cast<std::size_t>(sample.root_ns_size()));
    for (std::size_t chain = 0; chain < count; ++chain) {
      roots_ns_[chain] = std::max(roots_ns_[chain], sample.root_ns(static_cast<int>(chain)));
    }
  }

  void work(std::size_t cause) {
    for (Latest<LoadSample>& read : reads_) {
      if (const auto newest = read.get()) {
        merge(*newest);
      }
    }
    compute(computes_ns_.at(cause));
    for (Output& output : outputs_) {
      if (output.cause == cause && ++output.count % output.each == 0) {
        publish(output);
      }
    }
  }

  void publish(Output& output) {
    auto sample = output.publisher.loan();
    sample->mutable_root_ns()->Assign(roots_ns_.begin(), roots_ns_.end());
    sample->mutable_data()->resize(output.bytes);
    if (output.begins >= 0) {
      sample->set_root_ns(static_cast<int>(output.begins), measure::now_ns());
    }
    output.publisher.publish(std::move(sample));
  }

  Param<Path> file_;
  Numbers computes_ns_;
  Numbers ends_;
  std::vector<Output> outputs_;
  std::vector<Latest<LoadSample>> reads_;
  std::vector<std::int64_t> roots_ns_;  ///< Newest of all that it has received.
  std::vector<std::int64_t> ended_ns_;  ///< The last root of each chain that ends here.
  std::vector<std::pair<int, std::int64_t>> samples_;
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::LoadNode)
