// What the tests of the recorder record.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "benchmark/payload.pb.h"
#include "measure/clock.h"
#include "recorder/page.h"

namespace {

using fastcycle::benchmark::Payload;
using fastcycle::recorder_test::MappedPage;

/// Publishes messages of one size on the topic of its own name, one each period; after ticks that
/// were skipped as many at once. `number` is the message's sequence, and every byte of `data` the
/// same, never 0, or noise that cannot be compressed. Each message is noted in a page once
/// `publish` has returned.
class Stream final : public fastcycle::Component {
 public:
  explicit Stream(fastcycle::Context& context)
      : Component(context),
        size_(static_cast<std::size_t>(
            context.param<std::int64_t>("size_bytes", {.min = 0, .max = 1 << 30}).get())),
        count_(context.param<std::int64_t>("count", {.fallback = 0, .min = 0}).get()),
        is_noise_(context.param<bool>("is_noise", {.fallback = false}).get()),
        payload_(context.create_publisher<Payload>(context.component_name(),
                                                   {.prototype = prototype(size_)})),
        source_(context.create_source()) {
    const auto page = context.param<fastcycle::Path>("page", {.fallback = fastcycle::Path()});
    if (!page.get().empty()) {
      page_ = std::make_unique<MappedPage>(page.get().string());
    }
    const auto period_us = context.param<std::int64_t>("period_us", {.min = 1});
    context.create_timer(
        {.period = std::chrono::microseconds(period_us.get())},
        [this](const fastcycle::Tick& tick) { publish(1 + std::min(tick.skipped, kMostSkipped)); });
  }

 private:
  static constexpr std::uint64_t kMostSkipped = 32;

  static Payload prototype(std::size_t size) {
    Payload payload;
    payload.mutable_data()->assign(size, 'x');
    return payload;
  }

  void publish(std::uint64_t messages) {
    for (; messages > 0 && !is_done(); --messages) {
      ++sequence_;
      auto payload = payload_.loan_uncleared();
      payload->set_number(static_cast<std::int64_t>(sequence_));
      payload->mutable_data()->resize(size_);
      fill(*payload->mutable_data());
      payload_.publish(std::move(payload));
      if (page_ != nullptr) {
        (*page_)->note(sequence_, fastcycle::measure::now_ns());
      }
    }
    if (is_done()) {
      source_.finish();
    }
  }

  void fill(std::string& data) {
    if (is_noise_) {
      std::ranges::generate(data, [this] { return static_cast<char>(random()() & 0xFFU); });
    } else {
      std::memset(data.data(), static_cast<int>(1 + sequence_ % 255), size_);
    }
  }

  [[nodiscard]] bool is_done() const {
    return count_ > 0 && sequence_ >= static_cast<std::uint64_t>(count_);
  }

  const std::size_t size_;
  const std::int64_t count_;
  const bool is_noise_;
  fastcycle::Publisher<Payload> payload_;
  fastcycle::Source source_;
  std::unique_ptr<MappedPage> page_;
  std::uint64_t sequence_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Stream)
