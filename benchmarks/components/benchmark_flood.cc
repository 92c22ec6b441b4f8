// Both ends of a flood: one sends as fast as it can, the other counts.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "components/payload.h"
#include "components/results.h"
#include "measure/clock.h"
#include "measure/usage.h"

namespace {

using fastcycle::benchmark::Credit;
using fastcycle::benchmark::Payload;
using fastcycle::measure::now_ns;
using fastcycle::measure::Usage;

constexpr std::int64_t kBatches = 4;  // A window is given back in quarters.
constexpr std::int64_t kLast = -1;    // In `sent_ns`, which is otherwise unused in a flood.

/// Sends `count` payloads, a batch for each credit, initially a whole window. Those of the first
/// `run_in_ms` are sent in addition, and not counted. Without credits it sends batch after batch
/// from a timer that it rearms, whether or not they arrive.
class FloodSource final : public fastcycle::Component {
 public:
  explicit FloodSource(fastcycle::Context& context)
      : Component(context),
        size_(static_cast<std::size_t>(
            context.param<std::int64_t>("size_bytes", {.fallback = 64, .min = 0, .max = 1 << 30})
                .get())),
        end_(context.param<std::int64_t>("count", {.fallback = 1'000'000, .min = 1}).get()),
        run_in_ns_(
            1'000'000 *
            context.param<std::int64_t>("run_in_ms", {.fallback = 0, .min = 0, .max = 10'000})
                .get()),
        window_(context.param<std::int64_t>("window", {.fallback = 1024, .min = kBatches}).get()),
        waits_for_credits_(context.param<bool>("waits_for_credits", {.fallback = true}).get()),
        payload_(context.create_publisher<Payload>(
            "payload", {.prototype = fastcycle::benchmark::prototype(size_)})),
        source_(context.create_source()),
        timer_(context.create_timer([this] { on_timer(); })) {
    if (waits_for_credits_) {
      context.create_subscriber<Credit>("credit", [this](const Credit& credit) { take(credit); });
    }
  }

  void start() override { timer_.arm_at(now() + kPause); }

  void stop() override {
    report("run_in", first_);
    report("sent", number_ - first_);
    report("first_sent_ns", first_sent_ns_);
    fastcycle::benchmark::report_usage(context(), usage_);
  }

 private:
  /// Before the first message, so that all have started; after the last, so that it has arrived.
  static constexpr std::chrono::milliseconds kPause{20};

  void on_timer() {
    if (number_ == 0) {
      begin();
    }
    if (number_ == end_) {
      finish();
      return;
    }
    send_up_to(number_ + (waits_for_credits_ ? window_ : window_ / kBatches));
    if (!waits_for_credits_) {
      timer_.arm_at(number_ == end_ ? now() + kPause : now());
    }
  }

  void take(const Credit& credit) {
    if (first_ == 0 && run_in_ns_ > 0 && now_ns() - first_sent_ns_ >= run_in_ns_) {
      first_ = number_;
      end_ += number_;
      begin();
    }
    send_up_to(credit.received() + window_);
    if (credit.received() == end_) {
      finish();
    }
  }

  void begin() {
    at_begin_ = Usage::now();
    first_sent_ns_ = now_ns();
  }

  [[nodiscard]] bool is_running_in() const { return run_in_ns_ > 0 && first_ == 0; }

  void send_up_to(std::int64_t end) {
    for (end = is_running_in() ? end : std::min(end, end_); number_ < end; ++number_) {
      auto payload = payload_.loan_uncleared();
      payload->mutable_data()->resize(size_);
      fastcycle::measure::fill(payload->mutable_data()->data(), size_, number_);
      payload->set_number(number_);
      payload->set_sent_ns(!is_running_in() && number_ + 1 == end_ ? kLast : 0);
      payload_.publish(std::move(payload));
    }
  }

  void finish() {
    usage_ = Usage::now() - at_begin_;
    source_.finish();
  }

  const std::size_t size_;
  std::int64_t end_;  ///< The number of the message after the last.
  const std::int64_t run_in_ns_;
  const std::int64_t window_;
  const bool waits_for_credits_;
  fastcycle::Publisher<Payload> payload_;
  fastcycle::Source source_;
  fastcycle::Timer timer_;
  std::int64_t number_ = 0;
  std::int64_t first_ = 0;  ///< The first counted one.
  std::int64_t first_sent_ns_ = 0;
  Usage at_begin_;
  Usage usage_;
};

/// Counts received messages, and optionally returns credits. The clock is read at the last message;
/// if that one may be lost, at each.
class FloodSink final : public fastcycle::Component {
 public:
  explicit FloodSink(fastcycle::Context& context)
      : Component(context),
        batch_(context.param<std::int64_t>("window", {.fallback = 1024, .min = kBatches}).get() /
               kBatches),
        gives_credits_(context.param<bool>("gives_credits", {.fallback = true}).get()),
        credit_(context.create_publisher<Credit>("credit")) {
    context.create_subscriber<Payload>("payload",
                                       [this](const Payload& payload) { take(payload); });
  }

  void stop() override {
    report("received", received_);
    report("damaged", damaged_);
    report("last_received_ns", last_received_ns_);
  }

 private:
  void take(const Payload& payload) {
    const bool is_in_order = payload.number() > last_number_;
    last_number_ = payload.number();
    damaged_ += is_in_order && fastcycle::benchmark::is_whole(payload) ? 0 : 1;
    ++received_;
    const bool is_last = payload.sent_ns() == kLast;
    if (!gives_credits_ || is_last) {
      last_received_ns_ = now_ns();
    }
    if (gives_credits_ && (received_ % batch_ == 0 || is_last)) {
      auto credit = credit_.loan();
      credit->set_received(received_);
      credit_.publish(std::move(credit));
    }
  }

  const std::int64_t batch_;
  const bool gives_credits_;
  fastcycle::Publisher<Credit> credit_;
  std::int64_t received_ = 0;
  std::int64_t damaged_ = 0;
  std::int64_t last_number_ = -1;
  std::int64_t last_received_ns_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENTS(FloodSource, FloodSink)
