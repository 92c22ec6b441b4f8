#include "live/graph.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <thread>

#include <fmt/format.h>

#include "duration.h"
#include "live/session.h"
#include "live/text.h"
#include "option_values.h"
#include "report/graph.h"

namespace fastcycle::tool::live {
namespace {

using host::Drawing;

/// Growth of counters between two snapshots.
class Growth {
 public:
  Growth(const protocol::Overview& before, const protocol::Overview& now)
      : before_(before),
        now_(now),
        span_ns_(static_cast<double>(
            std::max<std::int64_t>(now.monotonic_ns() - before.monotonic_ns(), 1))) {}

  [[nodiscard]] double rate_hz(const protocol::Topic& topic) const {
    const auto found = std::ranges::find(before_.topics(), topic.name(), &protocol::Topic::name);
    const std::uint64_t earlier = found == before_.topics().end() ? 0 : found->published();
    return static_cast<double>(topic.published() - std::min(earlier, topic.published())) * 1e9 /
           span_ns_;
  }

  /// Of one CPU.
  [[nodiscard]] double cpu_percent(const protocol::Component& component) const {
    const auto found =
        std::ranges::find(before_.components(), component.name(), &protocol::Component::name);
    const std::int64_t earlier = found == before_.components().end() ? 0 : found->busy_ns();
    return 100.0 * static_cast<double>(component.busy_ns() - earlier) / span_ns_;
  }

  [[nodiscard]] const protocol::Overview& now() const { return now_; }

 private:
  const protocol::Overview& before_;
  const protocol::Overview& now_;
  const double span_ns_;
};

Drawing::Component drawn(const protocol::Component& component, const Growth& growth) {
  const std::size_t slash = component.name().rfind('/');
  Drawing::Component result{
      .name = component.name(),
      .name_space = slash == std::string::npos ? "" : component.name().substr(0, slash),
      .executor = component.executor(),
      .process = component.process()};
  result.about = component.class_name().empty() ? component.library() : component.class_name();
  if (!component.executor().empty()) {
    result.about += " · on " + component.executor();
  }
  if (component.state() == "elsewhere") {
    return result;
  }
  std::string text = fmt::format("{:.1f} % CPU", growth.cpu_percent(component));
  if (component.callback().count() > 0) {
    text += " · callback p99 " + span_text(component.callback().p99_ns());
  }
  result.notes.push_back({.text = text});
  if (component.state() != "active" || component.health() != "ok") {
    result.notes.push_back({.text = component.state() + ", " + component.health(),
                            .is_bad = component.state() == "failed" || component.health() != "ok"});
  }
  if (component.faults() > 0) {
    result.notes.push_back({.text = count_text(component.faults(), "fault"), .is_bad = true});
  }
  return result;
}

/// Latency, and what was lost.
Drawing::Note note_of(const protocol::Subscriber& subscriber) {
  std::string text;
  if (subscriber.latency().count() > 0) {
    text = "p99 " + span_text(subscriber.latency().p99_ns());
  }
  const std::uint64_t dropped = subscriber.ledger().dropped();
  if (dropped > 0) {
    text += fmt::format("{}{} dropped", text.empty() ? "" : ", ", dropped);
  }
  return {.text = text, .is_bad = dropped > 0};
}

bool has_component(const protocol::Overview& overview, const std::string& name) {
  return std::ranges::find(overview.components(), name, &protocol::Component::name) !=
         overview.components().end();
}

Drawing::Topic drawn(const protocol::Topic& topic, const Growth& growth) {
  Drawing::Topic result{.name = topic.name(), .type = topic.type()};
  for (const protocol::Publisher& publisher : topic.publishers()) {
    if (has_component(growth.now(), publisher.component())) {
      result.publishers.push_back({.component = publisher.component(),
                                   .style = publisher.is_external() ? host::kExternalStyle : ""});
    }
  }
  for (const protocol::Subscriber& subscriber : topic.subscribers()) {
    if (has_component(growth.now(), subscriber.component())) {
      const bool is_called = subscriber.kind() == "callback" || subscriber.kind() == "synchronized";
      result.subscribers.push_back({.component = subscriber.component(),
                                    .style = is_called ? "" : host::kLookingStyle,
                                    .note = note_of(subscriber)});
    }
  }
  const double hz = growth.rate_hz(topic);
  result.notes.push_back({.text = hz > 0.0 ? rate_text(hz) : "silent"});
  return result;
}

/// The graph of a running application within `span`.
std::string graph_of(const Target& target, Duration span) {
  Session session(target, "graph --live");
  const protocol::Overview before = session.overview();
  std::this_thread::sleep_for(span);
  const protocol::Overview now = session.overview();
  const Growth growth(before, now);
  Drawing drawing{.name = now.application()};
  std::string state = "has run for " + uptime_text(uptime_ns(now));
  state += now.mode().empty() ? "" : " · mode " + now.mode();
  drawing.notes.push_back({.text = state});
  for (const protocol::Component& component : now.components()) {
    drawing.components.push_back(drawn(component, growth));
  }
  for (const protocol::Topic& topic : now.topics()) {
    drawing.topics.push_back(drawn(topic, growth));
  }
  return host::to_dot(drawing);
}

}  // namespace

void GraphOptions::add_to(CLI::App& line) {
  line.get_option("application")->required(false);  // Not with --live.
  line.add_flag("--live", is_asked, "Draw a running application, with its measurements");
  line.add_option("--app", application, "The running application (the only one)")
      ->type_name("NAME");
  line.add_option("--over", span, "With --live: time over which rates are measured (1s)")
      ->check(is_time())
      ->type_name("TIME");
}

int GraphOptions::run(const CLI::App& line, const std::function<int()>& of_file,
                      const std::function<int(const std::string& dot)>& write) const {
  return guarded("graph", [&] {
    if (!is_asked) {
      require_file(line);
      return of_file();
    }
    require_live_only(line, {"app", "output", "over"});
    return write(graph_of({.application = application}, *parse_duration(span)));
  });
}

}  // namespace fastcycle::tool::live
