// The components that the tests of the launcher put together.

#include <cstdint>
#include <stdexcept>
#include <string>

#include <fastcycle/fastcycle.h>
#include <unistd.h>

#include "launcher/number.pb.h"

namespace {

/// Publishes `burst` numbers, counted from 1, on `numbers` in every Serve period, until it has
/// published `count` of them: then its input is over. With `count` 0 it never is.
class Counter final : public fastcycle::Component {
 public:
  explicit Counter(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 0, .min = 0})),
        burst_(context.param<std::int64_t>("burst", {.fallback = 1,
                                                     .min = 1,
                                                     .unit = "messages",
                                                     .description = "In every period",
                                                     .is_tunable = true})),
        numbers_(context.create_publisher<launcher::Number>("numbers")),
        source_(context.create_source()) {}

  void serve() override {
    for (std::int64_t i = 0; i < burst_.get() && !is_finished(); ++i) {
      auto number = numbers_.loan();
      number->set_value(++published_);
      numbers_.publish(std::move(number));
    }
    if (is_finished()) {
      source_.finish();
    }
  }

  void stop() override { report("published", published_); }

 private:
  [[nodiscard]] bool is_finished() const { return count_.get() > 0 && published_ == count_.get(); }

  fastcycle::Param<std::int64_t> count_;
  fastcycle::Param<std::int64_t> burst_;
  fastcycle::Publisher<launcher::Number> numbers_;
  fastcycle::Source source_;
  std::int64_t published_ = 0;
};

/// Adds up what it receives on `numbers`, says so once it received the 10th, and reports the sum, a
/// hash of what it received and when, and its params.
class Adder final : public fastcycle::Component {
 public:
  explicit Adder(fastcycle::Context& context)
      : Component(context),
        high_(context.param<std::int64_t>("limits.high", {.fallback = 100, .min = 0})),
        text_(context.param<std::string>("text", {.fallback = "none"})),
        sums_(context.create_publisher<launcher::Number>("sums")) {
    context.create_subscriber<launcher::Number>(
        "numbers", [this](const launcher::Number& number) { on_number(number); });
  }

  void stop() override {
    report("sum", sum_);
    report("received", received_);
    report("hash", static_cast<std::int64_t>(hash_));
    report("high", high_.get());
    report("text", text_.get());
  }

 private:
  void on_number(const launcher::Number& number) {
    sum_ += number.value();
    hash_ = hash_ * 31 + static_cast<std::uint64_t>(number.value());
    hash_ = hash_ * 31 + static_cast<std::uint64_t>(now().time_since_epoch().count());
    if (++received_ == 10) {
      log().info("received ten numbers");
      log().info("its text is {}", text_.get());
    }
    auto sum = sums_.loan();
    sum->set_value(sum_);
    sums_.publish(std::move(sum));
  }

  fastcycle::Param<std::int64_t> high_;
  fastcycle::Param<std::string> text_;
  fastcycle::Publisher<launcher::Number> sums_;
  std::int64_t sum_ = 0;
  std::int64_t received_ = 0;
  std::uint64_t hash_ = 0;
};

/// What would clear a terminal, and set a colour.
constexpr const char* kSteering =
    ", \x1b[2J \xc2\x9b"
    "31m \r \xff";

/// Throws where `where` says.
class Trouble final : public fastcycle::Component {
 public:
  explicit Trouble(fastcycle::Context& context)
      : Component(context), where_(context.param<std::string>("where")) {
    throw_if("constructor");
    context.create_subscriber<launcher::Number>("numbers", [this](const launcher::Number&) {
      throw_if("callback");
      log().info("received a number");
    });
  }
  ~Trouble() noexcept(false) override { throw_if("destructor"); }

  void start() override { throw_if("start"); }
  void serve() override { throw_if("serve"); }
  void stop() override { throw_if("stop"); }

 private:
  void throw_if(const char* where) const {
    if (where_.get() == where) {
      throw std::runtime_error(std::string("trouble in ") + where + kSteering);
    }
    if (where_.get() == std::string("hang in ") + where) {
      log().info("it hangs now");
      for (;;) {
        pause();
      }
    }
  }

  fastcycle::Param<std::string> where_;
};

/// Asks for a dump when it receives the 20th number.
class Alarm final : public fastcycle::Component {
 public:
  explicit Alarm(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<launcher::Number>("numbers", [this](const launcher::Number& number) {
      if (number.value() == 20) {
        this->context().dump_flight_recorder("Hard braking");
      }
    });
  }
};

/// Adds up what it receives on `numbers`, in declared state, and says so on `totals`. Has the
/// flight recorder write at the number `dump_at`.
class Tally final : public fastcycle::Component {
 public:
  explicit Tally(fastcycle::Context& context)
      : Component(context),
        dump_at_(context.param<std::int64_t>("dump_at", {.fallback = 0})),
        sum_(context.state<launcher::Number>("sum")),
        totals_(context.create_publisher<launcher::Number>("totals")) {
    context.create_subscriber<launcher::Number>("numbers", [this](const launcher::Number& number) {
      sum_->set_value(sum_->value() + number.value());
      auto total = totals_.loan();
      total->set_value(sum_->value());
      totals_.publish(std::move(total));
      if (number.value() == dump_at_.get()) {
        this->context().dump_flight_recorder("the test says so");
      }
    });
  }

 private:
  fastcycle::Param<std::int64_t> dump_at_;
  fastcycle::State<launcher::Number> sum_;
  fastcycle::Publisher<launcher::Number> totals_;
};

}  // namespace

FASTCYCLE_COMPONENTS(Counter, Adder, Trouble, Alarm, Tally)
