// fastcycle topic hz, bw and delay: numbers of the messages of the last seconds, again and again.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command.h"
#include "duration.h"
#include "live/session.h"
#include "live/text.h"
#include "live/topic.h"
#include "option_values.h"
#include "quantity.h"

namespace fastcycle::tool::live {
namespace {

using Clock = std::chrono::steady_clock;

enum class Kind { kRate, kBandwidth, kDelay };

struct RateOptions {
  Kind kind = Kind::kRate;
  std::string command;  ///< "topic hz"
  Target target;
  std::string topic;
  std::string every = "1s";
  std::string window = "10s";
  std::optional<std::uint64_t> count;
};

/// The recorded facts about a message.
struct Seen {
  std::int64_t publish_ns = 0;
  std::int64_t age_ns = 0;
  std::uint64_t bytes = 0;
};

/// The messages of the last seconds.
class Window {
 public:
  /// The maximum number of messages kept, whatever the window.
  static constexpr std::size_t kMost = 1'000'000;

  explicit Window(std::int64_t length_ns) : length_ns_(length_ns) {}

  void add(const Seen& seen) {
    seen_.push_back(seen);
    newest_ns_ = std::max(newest_ns_, seen.publish_ns);
    ++all_;
    while (seen_.size() > kMost || seen_.front().publish_ns < newest_ns_ - length_ns_) {
      seen_.pop_front();
    }
  }
  void lose(std::uint64_t count) { lost_ += count; }

  [[nodiscard]] const std::deque<Seen>& seen() const { return seen_; }
  [[nodiscard]] std::uint64_t all() const { return all_; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

  /// From the first to the last one.
  [[nodiscard]] double span_s() const {
    return seen_.empty() ? 0.0 : static_cast<double>(newest_ns_ - seen_.front().publish_ns) / 1e9;
  }

 private:
  const std::int64_t length_ns_;
  std::deque<Seen> seen_;
  std::int64_t newest_ns_ = 0;
  std::uint64_t all_ = 0;
  std::uint64_t lost_ = 0;
};

/// Of some numbers.
struct Summary {
  double mean = 0.0;
  double min = 0.0;
  double max = 0.0;
  double sd = 0.0;
  double p50 = 0.0;
  double p99 = 0.0;
};

Summary summary_of(std::vector<double> numbers) {
  Summary result;
  if (numbers.empty()) {
    return result;
  }
  std::ranges::sort(numbers);
  const auto count = static_cast<double>(numbers.size());
  for (const double number : numbers) {
    result.mean += number / count;
  }
  for (const double number : numbers) {
    result.sd += (number - result.mean) * (number - result.mean) / count;
  }
  result.sd = std::sqrt(result.sd);
  const auto rank = [&](double share) {
    return numbers[static_cast<std::size_t>(std::ceil(share * count)) - 1];
  };
  result.min = numbers.front();
  result.max = numbers.back();
  result.p50 = rank(0.50);
  result.p99 = rank(0.99);
  return result;
}

/// From each message to the next.
std::vector<double> periods_of(const Window& window) {
  std::vector<std::int64_t> times;
  for (const Seen& seen : window.seen()) {
    times.push_back(seen.publish_ns);
  }
  std::ranges::sort(times);  // Those of several publishers may come in another order.
  std::vector<double> periods;
  for (std::size_t i = 1; i < times.size(); ++i) {
    periods.push_back(static_cast<double>(times[i] - times[i - 1]));
  }
  return periods;
}

/// Per second; 0 if there are not two.
double per_second(double count, const Window& window) {
  return window.span_s() > 0.0 ? count / window.span_s() : 0.0;
}

double rate_of(const Window& window) {
  return per_second(static_cast<double>(window.seen().size()) - 1.0, window);
}

// ---- Output of the three commands ----

std::string rate_line(const Window& window) {
  const Summary period = summary_of(periods_of(window));
  return fmt::format("{}   from one to the next {} to {}, sd {}", rate_text(rate_of(window)),
                     span_text(period.min), span_text(period.max), span_text(period.sd));
}

Json rate_json(const Window& window) {
  const Summary period = summary_of(periods_of(window));
  return {{"rate_hz", rate_of(window)},
          {"period_mean_ns", period.mean},
          {"period_min_ns", period.min},
          {"period_max_ns", period.max},
          {"period_sd_ns", period.sd}};
}

Summary sizes_of(const Window& window) {
  std::vector<double> sizes;
  for (const Seen& seen : window.seen()) {
    sizes.push_back(static_cast<double>(seen.bytes));
  }
  return summary_of(std::move(sizes));
}

double bytes_per_second(const Window& window) {
  return rate_of(window) * sizes_of(window).mean;
}

std::string bandwidth_line(const Window& window) {
  const auto bytes = [](double number) {
    return bytes_text(static_cast<std::uint64_t>(std::llround(number)));
  };
  const Summary size = sizes_of(window);
  return fmt::format("{}/s   a message {} on average, {} to {}", bytes(bytes_per_second(window)),
                     bytes(size.mean), bytes(size.min), bytes(size.max));
}

Json bandwidth_json(const Window& window) {
  const Summary size = sizes_of(window);
  return {{"bytes_per_s", bytes_per_second(window)},
          {"bytes_mean", size.mean},
          {"bytes_min", size.min},
          {"bytes_max", size.max}};
}

Summary ages_of(const Window& window) {
  std::vector<double> ages;
  for (const Seen& seen : window.seen()) {
    ages.push_back(static_cast<double>(seen.age_ns));
  }
  return summary_of(std::move(ages));
}

std::string delay_line(const Window& window, const protocol::Topic& topic) {
  const Summary age = ages_of(window);
  const protocol::Histogram& latency = topic.latency();
  std::string text = fmt::format("published {} after the measurement (p99 {}, max {})",
                                 span_text(age.p50), span_text(age.p99), span_text(age.max));
  if (latency.count() > 0) {
    text += fmt::format("   to the callback {} (p99 {}, max {})", span_text(latency.p50_ns()),
                        span_text(latency.p99_ns()), span_text(latency.max_ns()));
  }
  return text;
}

Json delay_json(const Window& window, const protocol::Topic& topic) {
  const Summary age = ages_of(window);
  return {{"age_mean_ns", age.mean},
          {"age_p50_ns", age.p50},
          {"age_p99_ns", age.p99},
          {"age_max_ns", age.max},
          {"latency", json_of(topic.latency())}};
}

/// Prints, every period, what the window shows.
class RatePrinter {
 public:
  RatePrinter(Session& session, const RateOptions& options, Output& output)
      : session_(session),
        options_(options),
        output_(output),
        every_(*parse_duration(options.every)),
        window_(parse_duration(options.window)->count()),
        due_(Clock::now() + every_) {}

  /// Returns false when the output is complete.
  bool take(const protocol::Answer* answer) {
    if (answer != nullptr && answer->has_messages()) {
      window_.lose(answer->messages().lost());
      for (const protocol::Message& message : answer->messages().messages()) {
        window_.add({.publish_ns = message.publish_time_ns(),
                     .age_ns = message.publish_time_ns() - message.taken_ns(),
                     .bytes = message.bytes()});
      }
    }
    if (Clock::now() < due_) {
      return true;
    }
    due_ += every_ * (1 + (Clock::now() - due_) / every_);
    return output_.write(options_.target.is_json ? json() : text()) &&
           (!options_.count || ++printed_ < *options_.count);
  }

 private:
  [[nodiscard]] protocol::Topic topic() {
    protocol::Request request;
    request.mutable_topic()->set_topic(options_.topic);
    return session_.client().ask(std::move(request)).topic();
  }

  std::string text() {
    const std::uint64_t before = std::exchange(all_before_, window_.all());
    if (window_.all() == 0) {
      return "no message yet\n";
    }
    std::string line = options_.kind == Kind::kRate        ? rate_line(window_)
                       : options_.kind == Kind::kBandwidth ? bandwidth_line(window_)
                                                           : delay_line(window_, topic());
    if (window_.all() == 1 && options_.kind != Kind::kDelay) {
      line = "1 message so far";
    }
    line += fmt::format("   of {}", count_text(window_.seen().size(), "message"));
    line += window_.all() == before ? ", none of them new" : "";
    line += window_.lost() > 0 ? fmt::format(", {} not seen", window_.lost()) : "";
    return line + "\n";
  }

  std::string json() {
    Json json{{"topic", options_.topic},
              {"messages", window_.seen().size()},
              {"window_s", window_.span_s()},
              {"lost", window_.lost()}};
    json.update(options_.kind == Kind::kRate        ? rate_json(window_)
                : options_.kind == Kind::kBandwidth ? bandwidth_json(window_)
                                                    : delay_json(window_, topic()));
    return json_line(json);
  }

  Session& session_;
  const RateOptions& options_;
  Output& output_;
  const Clock::duration every_;
  Window window_;
  Clock::time_point due_;
  std::uint64_t printed_ = 0;
  std::uint64_t all_before_ = 0;
};

int show(const RateOptions& options) {
  Session session(options.target, options.command);
  require_known(options.topic, names_of_topics(session.overview(), true), "topic");
  protocol::Request request;
  protocol::Stream& stream = *request.mutable_stream();
  stream.set_topic(options.topic);
  stream.set_content(protocol::Stream::CONTENT_INFO);
  stream.set_with_size(options.kind == Kind::kBandwidth);
  Output output;
  Streams streams(session);
  streams.begin(std::move(request));
  RatePrinter printer(session, options, output);
  streams.follow(output, [&](const protocol::Answer* answer) { return printer.take(answer); });
  output.flush();
  return kDone;
}

Command add_rate(CLI::App& group, Kind kind, const std::string& word, const std::string& what,
                 const std::string& more) {
  CLI::App* line = group.add_subcommand(word, what);
  const std::string command = "fastcycle topic " + word;
  line->footer(examples("  " + command + " control/speed\n  " + command +
                        " control/speed --count 1\n  " + command +
                        " control/speed --window 60s --every 5s\n  " + command +
                        " control/speed --json\n\n" + more + "Ctrl-C ends it.\n"));
  const auto options = std::make_shared<RateOptions>();
  options->kind = kind;
  options->command = "topic " + word;
  line->add_option("topic", options->topic, "The topic")->required()->type_name("TOPIC");
  line->add_option("--every", options->every, "Time between lines (1s)")
      ->check(is_time())
      ->type_name("TIME");
  line->add_option("--window", options->window, "Time over which messages are averaged (10s)")
      ->check(is_time())
      ->type_name("TIME");
  line->add_option("--count", options->count, "End after this number of lines")
      ->check(is_above_zero())
      ->type_name("N");
  options->target.add_to(*line, "Print one JSON object per line");
  return {line, [options] { return guarded(options->command, [&] { return show(*options); }); }};
}

}  // namespace

Command add_topic_hz(CLI::App& group) {
  return add_rate(group, Kind::kRate, "hz", "Show the rate of messages",
                  "The rate is computed from the publish times, in application time.\n");
}

Command add_topic_bw(CLI::App& group) {
  return add_rate(group, Kind::kBandwidth, "bw", "Show the bandwidth of a topic",
                  "Sizes are those of serialized messages; within the application, messages are\n"
                  "passed by pointer.\n");
}

Command add_topic_delay(CLI::App& group) {
  return add_rate(
      group, Kind::kDelay, "delay", "Show the age and latency of messages",
      "Age: from the oldest measurement that led to a message until its publish. Latency: from\n"
      "publish to callback, since the start, of the slowest subscriber.\n");
}

}  // namespace fastcycle::tool::live
