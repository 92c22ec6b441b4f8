// The components of the applications that run in several processes.

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>

#include <fastcycle/fastcycle.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "processes/reading.pb.h"
#include "status/log_line.pb.h"
#include "status/status.pb.h"

namespace {

using processes_test::Reading;

std::string text_of(std::int64_t value) {
  return "a text that does not fit into a string itself, number " + std::to_string(value);
}

/// Publishes readings, counted from 1, in every serve period; ends after `count` of them.
class Sensor final : public fastcycle::Component {
 public:
  explicit Sensor(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 1'000'000'000})),
        invalid_at_(context.param<std::int64_t>("invalid_at", {.fallback = 0})),
        readings_(context.create_publisher<Reading>("readings")),
        source_(context.create_source()) {}

  void serve() override {
    if (published_ == count_.get()) {
      source_.finish();
      return;
    }
    auto reading = readings_.loan();
    reading->set_value(++published_);
    reading->set_text(published_ == invalid_at_.get() ? "\xff is not UTF-8" : text_of(published_));
    reading->clear_points();
    for (int i = 0; i < 100; ++i) {
      reading->add_points(static_cast<double>(i) * static_cast<double>(published_));
    }
    readings_.publish(std::move(reading));
    report("process_of_source", std::int64_t{getpid()});
  }

 private:
  fastcycle::Param<std::int64_t> count_;
  fastcycle::Param<std::int64_t> invalid_at_;
  fastcycle::Publisher<Reading> readings_;
  fastcycle::Source source_;
  std::int64_t published_ = 0;
};

/// Publishes what it receives again.
class Relay final : public fastcycle::Component {
 public:
  explicit Relay(fastcycle::Context& context)
      : Component(context),
        crash_at_(context.param<std::int64_t>("crash_at", {.fallback = 0})),
        crash_again_at_(context.param<std::int64_t>("crash_again_at", {.fallback = 0})),
        hang_at_(context.param<std::int64_t>("hang_at", {.fallback = 0})),
        throw_at_(context.param<std::int64_t>("throw_at", {.fallback = 0})),
        throws_(context.param<bool>("throws", {.fallback = false})),
        write_at_(context.param<std::int64_t>("write_at", {.fallback = 0})),
        log_every_(context.param<std::int64_t>("log_every", {.fallback = 0})),
        dump_at_(context.param<std::int64_t>("dump_at", {.fallback = 0})),
        is_silent_(context.param<bool>("is_silent", {.fallback = false})),
        gain_(context.param<std::int64_t>("gain", {.fallback = 1, .max = 10, .is_tunable = true})),
        relayed_(context.create_publisher<Reading>("relayed")) {
    context.create_subscriber<Reading>("readings", {.depth = 400}, [this](const Reading& reading) {
      report("process_of_relay", std::int64_t{getpid()});
      report("gain_of_relay", gain_.get());
      if (reading.value() == 1) {
        const int socket_or_error = socket(AF_INET, SOCK_STREAM, 0);
        report("may_open_sockets", socket_or_error >= 0);
        if (socket_or_error >= 0) {
          close(socket_or_error);
        }
      }
      for (const std::int64_t crash_at : {crash_at_.get(), crash_again_at_.get()}) {
        if (crash_at != 0 && reading.value() == crash_at) {
          std::raise(SIGSEGV);
        }
      }
      if (hang_at_.get() != 0 && reading.value() == hang_at_.get()) {
        const std::atomic<bool> is_hanging{true};
        while (is_hanging.load()) {
        }
      }
      if (throws_.get()) {
        throw std::runtime_error("it always throws");
      }
      if (throw_at_.get() != 0 && reading.value() == throw_at_.get()) {
        throw std::runtime_error("it was asked to");
      }
      if (write_at_.get() != 0 && reading.value() == write_at_.get()) {
        const_cast<Reading&>(reading).set_value(-1);
      }
      if (log_every_.get() != 0 && reading.value() % log_every_.get() == 0) {
        log().warning("reading {}", reading.value());
      }
      if (dump_at_.get() != 0 && reading.value() == dump_at_.get()) {
        this->context().dump_flight_recorder("hard braking");
      }
      if (is_silent_.get()) {
        return;
      }
      auto relayed = relayed_.loan();
      relayed->CopyFrom(reading);
      relayed->set_value(reading.value() * gain_.get());
      relayed_.publish(std::move(relayed));
    });
  }

 private:
  fastcycle::Param<std::int64_t> crash_at_;
  fastcycle::Param<std::int64_t> crash_again_at_;
  fastcycle::Param<std::int64_t> hang_at_;
  fastcycle::Param<std::int64_t> throw_at_;
  fastcycle::Param<bool> throws_;
  fastcycle::Param<std::int64_t> write_at_;
  fastcycle::Param<std::int64_t> log_every_;
  fastcycle::Param<std::int64_t> dump_at_;
  fastcycle::Param<bool> is_silent_;
  fastcycle::Param<std::int64_t> gain_;
  fastcycle::Publisher<Reading> relayed_;
};

/// Publishes the sum of all readings, and how many there were. With `drifts`, the sum is wrong in
/// one of two processes; `resident_mb` of memory are touched and kept.
class Accumulator final : public fastcycle::Component {
 public:
  explicit Accumulator(fastcycle::Context& context)
      : Component(context),
        drifts_(context.param<bool>("drifts", {.fallback = false})),
        crash_at_(context.param<std::int64_t>("crash_at", {.fallback = 0})),
        stops_at_(context.param<std::int64_t>("stops_at", {.fallback = 0})),
        stops_once_(context.param<std::string>("stops_once", {.fallback = ""})),
        resident_(
            static_cast<std::size_t>(
                context.param<std::int64_t>("resident_mb", {.fallback = 0, .min = 0, .max = 4096})
                    .get())
                << 20U,
            'x'),
        sum_(context.state<Reading>("sum")),
        sums_(context.create_publisher<Reading>("sums")) {
    context.create_subscriber<Reading>("readings", {.depth = 200}, [this](const Reading& reading) {
      if (reading.value() == crash_at_.get()) {
        std::raise(SIGSEGV);
      }
      if (reading.value() == stops_at_.get()) {
        stop_once();
      }
      sum_->set_value(sum_->value() + reading.value());
      sum_->set_text(std::to_string(reading.value()));
      auto sum = sums_.loan();
      sum->CopyFrom(*sum_);
      if (drifts_.get() && reading.value() == 50) {
        sum->set_text(std::to_string(getpid()));
      }
      sums_.publish(std::move(sum));
      report("process_of_accumulator", std::int64_t{getpid()});
    });
  }

 private:
  /// Stands still in the process that comes here first.
  void stop_once() const {
    const int file =
        ::open(stops_once_.get().c_str(), O_CREAT | O_EXCL | O_CLOEXEC | O_WRONLY, 0600);
    if (file >= 0) {
      ::close(file);
      std::raise(SIGSTOP);
    }
  }

  fastcycle::Param<bool> drifts_;
  fastcycle::Param<std::int64_t> crash_at_;
  fastcycle::Param<std::int64_t> stops_at_;
  fastcycle::Param<std::string> stops_once_;
  std::string resident_;
  fastcycle::State<Reading> sum_;
  fastcycle::Publisher<Reading> sums_;
};

/// Looks whether each sum comes once, and is right.
class Auditor final : public fastcycle::Component {
 public:
  explicit Auditor(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<Reading>(
        "sums", {.depth = 1000}, [this](const fastcycle::Sample<Reading>& sum) {
          const auto sequence = static_cast<std::int64_t>(sum.info().sequence);
          missing_ += sequence > last_ + 1 ? sequence - last_ - 1 : 0;
          twice_ += sequence <= last_ ? 1 : 0;
          last_ = sequence;
          wrong_ += sum->value() == sequence * (sequence + 1) / 2 ? 0 : 1;
          report("sums", ++count_);
          report("missing", missing_);
          report("twice", twice_);
          report("wrong", wrong_);
        });
  }

 private:
  std::int64_t count_ = 0;
  std::int64_t last_ = 0;
  std::int64_t missing_ = 0;
  std::int64_t twice_ = 0;
  std::int64_t wrong_ = 0;
};

/// Counts the lines that the relay writes to the log.
class LogReader final : public fastcycle::Component {
 public:
  explicit LogReader(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<fastcycle::status::LogLine>(
        "/fastcycle/log", {.depth = 256}, [this](const fastcycle::status::LogLine& line) {
          if (line.component() == "relay") {
            report("lines_of_relay", ++lines_);
            report("last_line_of_relay", line.text());
          }
        });
  }

 private:
  std::int64_t lines_ = 0;
};

/// Looks at each reading, and counts those that are whole. With `subscribes_late`, tries that at
/// the first one.
class Sink final : public fastcycle::Component {
 public:
  explicit Sink(fastcycle::Context& context)
      : Component(context),
        subscribes_late_(context.param<bool>("subscribes_late", {.fallback = false})),
        relayed_(context.create_latest<Reading>("relayed")) {
    const auto more = context.param<std::int64_t>("more_subscribers", {.fallback = 0});
    for (std::int64_t i = 0; i < more.get(); ++i) {
      context.create_subscriber<Reading>("readings", [](const Reading&) {});
    }
    context.create_subscriber<Reading>("readings", {.depth = 400}, [this](const Reading& reading) {
      if (reading.value() == 1 && subscribes_late_.get()) {
        this->context().create_subscriber<Reading>("relayed", [](const Reading&) {});
      }
      const bool is_whole = reading.text() == text_of(reading.value()) &&
                            reading.points_size() == 100 &&
                            reading.points(99) == 99.0 * static_cast<double>(reading.value());
      whole_ += is_whole ? 1 : 0;
      report("whole", whole_);
      report("process_of_sink", std::int64_t{getpid()});
      const auto relayed = relayed_.get();
      report("relayed", relayed ? relayed->value() : std::int64_t{0});
    });
  }

 private:
  fastcycle::Param<bool> subscribes_late_;
  fastcycle::Latest<Reading> relayed_;
  std::int64_t whole_ = 0;
};

/// At some readings, asks for a mode and for a change of params of two components.
class Steering final : public fastcycle::Component {
 public:
  explicit Steering(fastcycle::Context& context)
      : Component(context),
        switch_at_(context.param<std::int64_t>("switch_at", {.fallback = 0})),
        back_at_(context.param<std::int64_t>("back_at", {.fallback = 0})),
        change_at_(context.param<std::int64_t>("change_at", {.fallback = 0})),
        gain_(context.param<std::string>("gain", {.fallback = "3"})),
        gains_(context.param<std::int64_t>("own_gain", {.fallback = 1, .is_tunable = true})),
        note_bytes_(context.param<std::int64_t>("note_bytes", {.fallback = 0})),
        notes_{context.param<std::string>("note_0", {.fallback = "", .is_tunable = true}),
               context.param<std::string>("note_1", {.fallback = "", .is_tunable = true}),
               context.param<std::string>("note_2", {.fallback = "", .is_tunable = true})} {
    context.create_subscriber<Reading>("readings", {.depth = 400}, [this](const Reading& reading) {
      if (reading.value() == switch_at_.get()) {
        this->context().switch_mode("degraded", "it was asked to");
      }
      if (reading.value() == back_at_.get()) {
        this->context().switch_mode("nominal");
      }
      if (reading.value() == change_at_.get()) {
        this->context().change_params({{"relay.gain", gain_.get()}, {"steering.own_gain", "7"}},
                                      [this](const fastcycle::ParamsResult& result) {
                                        report("has_changed", result.has_changed());
                                        report("errors",
                                               static_cast<std::int64_t>(result.errors.size()));
                                        if (!result.has_changed()) {
                                          report("error", result.errors.front());
                                        }
                                      });
      }
      // One after another: a transaction has no room for all.
      for (std::size_t i = 0; note_bytes_.get() > 0 && i < notes_.size(); ++i) {
        if (reading.value() == change_at_.get() + 30 * static_cast<std::int64_t>(i + 1)) {
          change("steering.note_" + std::to_string(i));
        }
      }
      report("own_gain", gains_.get());
    });
  }

 private:
  void change(const std::string& note) {
    const std::string text(static_cast<std::size_t>(note_bytes_.get()), 'x');
    context().change_params({{note, '"' + text + '"'}},
                            [this](const fastcycle::ParamsResult& result) {
                              noted_ += result.has_changed() ? 1 : 0;
                              report("noted", noted_);
                            });
  }

  std::int64_t noted_ = 0;
  fastcycle::Param<std::int64_t> switch_at_;
  fastcycle::Param<std::int64_t> back_at_;
  fastcycle::Param<std::int64_t> change_at_;
  fastcycle::Param<std::string> gain_;
  fastcycle::Param<std::int64_t> gains_;
  fastcycle::Param<std::int64_t> note_bytes_;
  std::array<fastcycle::Param<std::string>, 3> notes_;
};

/// Counts readings while it is active.
class Observer final : public fastcycle::Component {
 public:
  explicit Observer(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<Reading>("readings", {.depth = 400}, [this](const Reading& reading) {
      if (first_ == 0) {
        first_ = reading.value();
      }
      report("first_of_" + this->context().component_name(), first_);
      report("process_of_" + this->context().component_name(), std::int64_t{getpid()});
      report("last_of_" + this->context().component_name(), reading.value());
    });
  }

 private:
  std::int64_t first_ = 0;
};

/// Looks at the application's status: how the relay is.
class Watcher final : public fastcycle::Component {
 public:
  explicit Watcher(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<fastcycle::status::Status>(
        "fastcycle/status", [this](const fastcycle::status::Status& status) {
          for (const auto& one : status.components()) {
            if (one.name() != "relay") {
              continue;
            }
            if (one.state() == fastcycle::status::STATE_RESTARTING && ++failures_ == 1) {
              report("failure_of_relay", one.last_fault());
              report("health_of_relay", std::int64_t{one.health()});
            }
            report("failures_of_relay", failures_);
            report("state_of_relay", std::int64_t{one.state()});
            report("restarts_of_relay", static_cast<std::int64_t>(one.restarts()));
          }
        });
  }

 private:
  std::int64_t failures_ = 0;
};

/// Publishes `count` readings, as many at once as it has credits for.
class Reader final : public fastcycle::Component {
 public:
  explicit Reader(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count")),
        readings_(context.create_publisher<Reading>(
            "readings", {.credits = 4, .on_credits = [this] { send(); }})),
        source_(context.create_source()) {}

  // In simulated time a source that publishes only from `on_credits` does so at one moment.
  void serve() override { send(); }

 private:
  void send() {
    while (published_ < count_.get() && readings_.credits() > 0) {
      auto reading = readings_.loan();
      reading->set_value(++published_);
      readings_.publish(std::move(reading));
    }
    report("published", published_);
    if (published_ == count_.get()) {
      source_.finish();
    }
  }

  fastcycle::Param<std::int64_t> count_;
  fastcycle::Publisher<Reading> readings_;
  fastcycle::Source source_;
  std::int64_t published_ = 0;
};

/// The same from a thread, which waits for credits.
class ThreadReader final : public fastcycle::Component {
 public:
  explicit ThreadReader(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count")),
        readings_(context.create_external_publisher<Reading>("readings", {.credits = 4})),
        source_(context.create_source()) {
    context.create_thread("reader", [this](const std::stop_token& stop) {
      for (std::int64_t i = 1; i <= count_.get() && readings_.wait_for_credit(stop); ++i) {
        auto reading = readings_.loan();
        reading->set_value(i);
        readings_.publish(std::move(reading), fastcycle::kSimulatedStart);
      }
      source_.finish();
    });
  }

 private:
  fastcycle::Param<std::int64_t> count_;
  fastcycle::ExternalPublisher<Reading> readings_;
  fastcycle::Source source_;
};

/// Needs some time for each reading; counts those that come, and those missing between them.
class Store final : public fastcycle::Component {
 public:
  explicit Store(fastcycle::Context& context)
      : Component(context),
        work_us_(context.param<std::int64_t>("work_us", {.fallback = 0})),
        crash_at_(context.param<std::int64_t>("crash_at", {.fallback = 0})),
        log_at_(context.param<std::int64_t>("log_at", {.fallback = 0})) {
    context.create_subscriber<Reading>("readings", {.depth = 4}, [this](const Reading& reading) {
      missing_ += last_ == 0 ? 0 : reading.value() - last_ - 1;
      last_ = reading.value();
      ++received_;
      if (received_ == log_at_.get()) {
        log().info("it has {} readings", received_);
      }
      if (work_us_.get() > 0) {
        std::this_thread::sleep_for(std::chrono::microseconds(work_us_.get()));
      }
      if (reading.value() == crash_at_.get()) {
        raise(SIGSEGV);
      }
      report_counts();
    });
  }

  void start() override { report_counts(); }

 private:
  void report_counts() {
    report("received_by_" + context().component_name(), received_);
    report("missing_of_" + context().component_name(), missing_);
  }

  fastcycle::Param<std::int64_t> work_us_;
  fastcycle::Param<std::int64_t> crash_at_;
  fastcycle::Param<std::int64_t> log_at_;
  std::int64_t received_ = 0;
  std::int64_t last_ = 0;
  std::int64_t missing_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENTS(Sensor, Relay, Accumulator, Auditor, LogReader, Sink, Steering, Observer,
                     Watcher, Reader, ThreadReader, Store)
