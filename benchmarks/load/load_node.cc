#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "benchmark/load.pb.h"
#include "load/chains.h"
#include "measure/clock.h"

namespace fastcycle::benchmark {
namespace {

using Numbers = std::vector<std::int64_t>;

/// The root of each chain in `sample`.
auto roots_of(const LoadSample& sample) {
  return [&sample](std::size_t chain) {
    const auto number = static_cast<int>(chain);
    return number < sample.root_ns_size() ? sample.root_ns(number) : std::int64_t{0};
  };
}

/// A node of a load: timers and inputs, each with a time that it computes, and what it publishes
/// then. load.py makes the parameters.
class LoadNode final : public Component {
 public:
  explicit LoadNode(Context& context)
      : Component(context),
        file_(context.param<Path>("samples", {.fallback = Path()})),
        computes_ns_(numbers("computes_ns")),
        chains_(static_cast<std::size_t>(
                    context.param<std::int64_t>("chains", {.fallback = 0, .min = 0}).get()),
                numbers("ends")) {
    const Numbers periods_us = numbers("periods_us");
    const Numbers phases_us = numbers("phases_us");
    const auto inputs = context.param<std::int64_t>("inputs", {.fallback = 0, .min = 0}).get();
    const auto reads = context.param<std::int64_t>("reads", {.fallback = 0, .min = 0}).get();
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
      context.create_subscriber<LoadSample>("in_" + std::to_string(i),
                                            [this, cause](const LoadSample& sample) {
                                              chains_.arrived(cause, roots_of(sample));
                                              work(cause);
                                            });
    }
  }

  void stop() override { chains_.write(file_.get().string()); }

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

  void work(std::size_t cause) {
    for (Latest<LoadSample>& read : reads_) {
      if (const auto newest = read.get()) {
        chains_.depend_on(roots_of(*newest));
      }
    }
    load::compute(computes_ns_.at(cause));
    for (Output& output : outputs_) {
      if (output.cause == cause && ++output.count % output.each == 0) {
        publish(output);
      }
    }
  }

  void publish(Output& output) {
    auto sample = output.publisher.loan();
    const std::vector<std::int64_t>& roots_ns = chains_.roots_ns();
    sample->mutable_root_ns()->Assign(roots_ns.begin(), roots_ns.end());
    sample->mutable_data()->resize(output.bytes);
    if (output.begins >= 0) {
      sample->set_root_ns(static_cast<int>(output.begins), measure::now_ns());
    }
    output.publisher.publish(std::move(sample));
  }

  Param<Path> file_;
  Numbers computes_ns_;
  load::Chains chains_;
  std::vector<Output> outputs_;
  std::vector<Latest<LoadSample>> reads_;
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::LoadNode)
