#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command.h"
#include "duration.h"
#include "live/session.h"
#include "live/text.h"

namespace fastcycle::tool {
namespace live {
namespace {

struct ComponentOptions {
  Target target;
  std::string component;
};

struct ReloadOptions {
  ComponentOptions of;
  std::string library;
  std::string class_name;
  std::string params;
  std::string probation = "10s";
  std::uint32_t misses_forgiven = 2;
};

/// "ads/perception", or with its build where that is not the library of the application file.
std::string library_text(const protocol::Component& component) {
  constexpr std::size_t kDigits = 12;
  std::string text = component.library();
  if (!component.build_id().empty()) {
    text += ", build " + component.build_id().substr(0, kDigits);
  }
  return text + (component.is_on_probation() ? ", on probation" : "");
}

std::string health_text(const protocol::Component& component) {
  return component.health() + (component.health_reason().empty() ? "" : ": ") +
         component.health_reason();
}

std::string span_or_none(const protocol::Histogram& histogram, double ns) {
  return histogram.count() == 0 ? "-" : span_text(ns);
}

/// How much of one CPU its callbacks took, since the start.
std::string cpu_text(const protocol::Component& component, const protocol::Overview& overview) {
  const std::uint64_t ns = uptime_ns(overview);
  return ns == 0 || overview.clock() != "live"
             ? "-"
             : fmt::format("{:.1f} %", 100.0 * static_cast<double>(component.busy_ns()) /
                                           static_cast<double>(ns));
}

int list_components(const Target& target) {
  Session session(target, "component list");
  const protocol::Overview overview = session.overview();
  std::vector<std::vector<std::string>> rows{{"component", "state", "executor", "activations",
                                              "CPU", "p50", "p99", "max", "queued", "faults",
                                              "health", "library"}};
  const bool has_processes = std::ranges::any_of(
      overview.components(),
      [](const protocol::Component& component) { return !component.process().empty(); });
  if (has_processes) {
    rows.front().emplace_back("process");
  }
  Json json = Json::array();
  for (const protocol::Component& component : overview.components()) {
    const protocol::Histogram& callback = component.callback();
    rows.push_back(
        {component.name(), component.state(),
         component.executor().empty() ? "-" : component.executor(),
         fmt::format("{}", component.activations()), cpu_text(component, overview),
         span_or_none(callback, callback.p50_ns()), span_or_none(callback, callback.p99_ns()),
         span_or_none(callback, callback.max_ns()), fmt::format("{}", component.queued()),
         fmt::format("{}", component.faults()), health_text(component),
         component.library() + (component.is_on_probation() ? " (on probation)" : "")});
    if (has_processes) {
      rows.back().push_back(component.process().empty() ? "-" : component.process());
    }
    json.push_back(json_of(component));
  }
  return target.is_json ? print_json(json) : print_text(table_text(rows));
}

// ---- One component ----

void add_histogram(std::vector<std::vector<std::string>>& rows, const std::string& name,
                   const protocol::Histogram& histogram) {
  if (histogram.count() > 0) {
    rows.push_back(
        {name, fmt::format("p50 {}, p99 {}, p99.9 {}, max {} of {}", span_text(histogram.p50_ns()),
                           span_text(histogram.p99_ns()), span_text(histogram.p999_ns()),
                           span_text(histogram.max_ns()), histogram.count())});
  }
}

/// Its callbacks one by one; nothing if it has none.
std::string callbacks_text(const protocol::Component& component) {
  if (component.callbacks().empty()) {
    return {};
  }
  std::vector<std::vector<std::string>> rows{
      {"called for", "by", "count", "mean", "p50", "p99", "max"}};
  for (const protocol::Callback& callback : component.callbacks()) {
    const protocol::Histogram& time = callback.time();
    rows.push_back({callback.name(), callback.kind(), fmt::format("{}", time.count()),
                    span_or_none(time, time.mean_ns()), span_or_none(time, time.p50_ns()),
                    span_or_none(time, time.p99_ns()), span_or_none(time, time.max_ns())});
  }
  return "\n" + table_text(rows);
}

/// Its published and subscribed topics.
std::string topics_text(const protocol::Overview& overview, const std::string& component) {
  std::vector<std::vector<std::string>> published;
  std::vector<std::vector<std::string>> subscribed;
  for (const protocol::Topic& topic : overview.topics()) {
    for (const protocol::Publisher& publisher : topic.publishers()) {
      const bool is_state = topic.name().starts_with(component + "#state/");
      if (publisher.component() == component && !is_state) {
        published.push_back(
            {topic.name(), topic.type(), count_text(publisher.published(), "message")});
      }
    }
    for (const protocol::Subscriber& subscriber : topic.subscribers()) {
      if (subscriber.component() == component) {
        subscribed.push_back({topic.name(), topic.type(),
                              fmt::format("{} delivered", subscriber.ledger().delivered()),
                              fmt::format("{} queued", subscriber.ledger().queued()),
                              fmt::format("{} dropped", subscriber.ledger().dropped())});
      }
    }
  }
  return (published.empty() ? "\nIt publishes nothing.\n"
                            : "\npublishes\n" + table_text(published, "  ")) +
         (subscribed.empty() ? "\nIt subscribes to nothing.\n"
                             : "\nsubscribes to\n" + table_text(subscribed, "  "));
}

/// The state that it declares; nothing if it declares none.
std::string states_text(const protocol::Overview& overview, const std::string& component) {
  const std::string begin = component + "#state/";
  std::vector<std::vector<std::string>> states;
  for (const protocol::Topic& topic : overview.topics()) {
    if (topic.name().starts_with(begin)) {
      std::uint64_t frames = 0;
      for (const protocol::Publisher& publisher : topic.publishers()) {
        frames += publisher.published();
      }
      states.push_back({topic.name().substr(begin.size()), topic.type(),
                        count_text(frames, "key frame"), "fastcycle topic echo " + topic.name()});
    }
  }
  return states.empty() ? "" : "\nkeeps\n" + table_text(states, "  ");
}

std::string info_text(const protocol::Component& component, const protocol::Overview& overview) {
  std::vector<std::vector<std::string>> rows{
      {"component", component.name()},
      {"class", component.class_name().empty()
                    ? component.library()
                    : component.class_name() + " of " + component.library()},
      {"code", library_text(component)},
      {"executor", component.executor().empty() ? "-" : component.executor()},
      {"state", component.state()},
      {"health", health_text(component)},
      {"activations", count_text(component.activations(), "activation") + ", " +
                          cpu_text(component, overview) + " of a CPU"}};
  if (!component.process().empty()) {
    rows.insert(rows.begin() + 3, {"process", component.process()});
  }
  add_histogram(rows, "callback", component.callback());
  add_histogram(rows, "lateness", component.lateness());
  rows.push_back({"waiting", count_text(component.queued(), "message")});
  rows.push_back({"overruns", count_text(component.overruns(), "tick") + " skipped"});
  rows.push_back({"faults", count_text(component.faults(), "fault") + ", " +
                                count_text(component.restarts(), "restart")});
  if (!component.last_fault().empty()) {
    rows.push_back({"last fault", component.last_fault()});
  }
  if (!component.last_reload().empty()) {
    rows.push_back({"reloads", fmt::format("{}, {}", count_text(component.reloads(), "reload"),
                                           count_text(component.rollbacks(), "rollback"))});
    rows.push_back({"last reload", component.last_reload()});
  }
  std::string text;
  for (const auto& row : rows) {
    text += table_text({{row[0] + std::string(13 - row[0].size(), ' ') + row[1]}});
  }
  return text + callbacks_text(component) + topics_text(overview, component.name()) +
         states_text(overview, component.name());
}

int info(const ComponentOptions& options) {
  Session session(options.target, "component info");
  const protocol::Overview overview = session.overview();
  require_known(options.component, names_of_components(overview), "component");
  for (const protocol::Component& component : overview.components()) {
    if (component.name() == options.component) {
      return options.target.is_json ? print_json(json_of(component))
                                    : print_text(info_text(component, overview));
    }
  }
  return kFailed;
}

// ---- Life ----

int ask(const ComponentOptions& options, const std::string& command, protocol::Request request,
        std::chrono::milliseconds patience = inspect::Client::kPatience) {
  Session session(options.target, command);
  require_known(options.component, names_of_components(session.overview()), "component");
  request.mutable_lifecycle()->set_component(options.component);
  const std::string done = session.client().ask(std::move(request), patience).done().text();
  if (options.target.is_json) {
    return print_json({{"component", options.component}, {"done", done}});
  }
  return print_text((done.empty() ? options.component + ": done" : done) + "\n");
}

Command add_change(CLI::App& group, const std::string& word, const std::string& what,
                   protocol::Lifecycle::Action action, const std::string& allow = "lifecycle") {
  CLI::App* line = group.add_subcommand(word, what);
  line->footer(examples("  fastcycle component " + word +
                        " planner\n"
                        "\n"
                        "The application must allow it: \"inspect\": {\"allow\": [" +
                        allow + "\"]}.\n"));
  const auto options = std::make_shared<ComponentOptions>();
  line->add_option("component", options->component, "The component")
      ->required()
      ->type_name("COMPONENT");
  options->target.add_to(*line);
  const std::string command = "component " + word;
  return {line, [options, command, action] {
            return guarded(command, [&] {
              protocol::Request request;
              request.mutable_lifecycle()->set_action(action);
              return ask(*options, command, std::move(request));
            });
          }};
}

/// `said` is JSON, or the name of a file that contains it.
std::string params_text(const std::string& said) {
  if (said.empty() || said.front() == '{') {
    return said;
  }
  std::ifstream file(said);
  if (!file) {
    throw Failure(kWrong, "--params: " + said + " cannot be read: " + std::strerror(errno));
  }
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

int reload(const ReloadOptions& options) {
  protocol::Request request;
  protocol::Lifecycle& wanted = *request.mutable_lifecycle();
  wanted.set_action(protocol::Lifecycle::ACTION_RELOAD);
  // The run may have been started in another folder.
  const bool is_file = options.library.ends_with(".so");
  wanted.set_library(is_file ? std::filesystem::absolute(options.library).string()
                             : options.library);
  wanted.set_class_name(options.class_name);
  wanted.set_params_json(params_text(options.params));
  const auto probation = parse_duration(options.probation);
  if (!probation && options.probation != "0") {
    throw Failure(kWrong, "--probation expects a time with its unit, as 500ms, 10s or 2min, or 0");
  }
  wanted.set_probation_ns(probation ? probation->count() : 0);
  wanted.set_misses_forgiven(options.misses_forgiven);
  constexpr std::chrono::seconds kPatience{60};  // A trial may take long, and so may its threads.
  return ask(options.of, "component reload", std::move(request), kPatience);
}

Command add_reload(CLI::App& group) {
  CLI::App* line = group.add_subcommand(
      "reload", "Replace a component by one of another library, with rollback");
  line->footer(examples(
      "  fastcycle component reload planner --library planner_v2\n"
      "  fastcycle component reload planner --library build/libplanner.so --probation 30s\n"
      "  fastcycle component reload planner --library planner --params '{\"horizon_s\": 4}'\n"
      "\n"
      "The new component is first tested in a separate process. It receives the declared state,\n"
      "and no message is lost. A fault, a hanging call or missed deadlines during the probation\n"
      "roll it back. The application must allow it: \"inspect\": {\"allow\": [\"reload\"]}.\n"));
  const auto options = std::make_shared<ReloadOptions>();
  line->add_option("component", options->of.component, "The component")
      ->required()
      ->type_name("COMPONENT");
  line->add_option("--library", options->library,
                   "The library: a name as in the application file, or a file")
      ->required()
      ->type_name("NAME|FILE.so");
  line->add_option("--class", options->class_name, "The class, if the library contains several")
      ->type_name("NAME");
  line->add_option("--params", options->params, "Params to change: a JSON object or its file")
      ->type_name("JSON|FILE");
  line->add_option("--probation", options->probation,
                   "Duration of the probation in application time (10s); 0: no rollback")
      ->type_name("TIME");
  line->add_option("--misses-forgiven", options->misses_forgiven,
                   "Number of missed deadlines that do not cause a rollback (2)")
      ->type_name("N");
  options->of.target.add_to(*line);
  return {line,
          [options] { return guarded("component reload", [&] { return reload(*options); }); }};
}

Command add_list_of_components(CLI::App& group) {
  CLI::App* line =
      group.add_subcommand("list", "List components with their state, activity and callback times");
  line->footer(
      examples("  fastcycle component list\n"
               "  fastcycle component list --json | jq '.[] | select(.faults > 0).name'\n"
               "\n"
               "CPU: share of one CPU within callbacks, since the start. p50, p99, max:\n"
               "callback duration.\n"));
  const auto target = std::make_shared<Target>();
  target->add_to(*line);
  return {line,
          [target] { return guarded("component list", [&] { return list_components(*target); }); }};
}

Command add_info_of_component(CLI::App& group) {
  CLI::App* line = group.add_subcommand("info", "Show all information about one component");
  line->footer(examples(
      "  fastcycle component info planner\n"
      "  fastcycle component info planner --json | jq .callback.p99_ns\n"
      "  fastcycle component info planner --json | jq '.callbacks[] | [.name, .time.p99_ns]'\n"));
  const auto options = std::make_shared<ComponentOptions>();
  line->add_option("component", options->component, "The component")
      ->required()
      ->type_name("COMPONENT");
  options->target.add_to(*line);
  return {line, [options] { return guarded("component info", [&] { return info(*options); }); }};
}

}  // namespace
}  // namespace live

Command add_component(CLI::App& program) {
  using live::protocol::Lifecycle;
  CLI::App* group = program.add_subcommand(
      "component", "Inspect, start and stop the components of a running application");
  group->require_subcommand(0, 1);
  group->footer(
      examples("  fastcycle component list\n"
               "  fastcycle component info planner\n"
               "  fastcycle component restart planner\n"
               "  fastcycle component reload planner --library planner_v2\n"));
  return {.line = group,
          .words = {live::add_list_of_components(*group), live::add_info_of_component(*group),
                    live::add_change(*group, "start", "Activate a component that was stopped",
                                     Lifecycle::ACTION_START),
                    live::add_change(*group, "stop", "Deactivate a component: its callbacks end",
                                     Lifecycle::ACTION_STOP),
                    live::add_change(*group, "switch", "Switch a component to its standby",
                                     Lifecycle::ACTION_SWITCH),
                    live::add_change(*group, "restart", "Restart a component, as after a fault",
                                     Lifecycle::ACTION_RESTART),
                    live::add_reload(*group),
                    live::add_change(*group, "rollback", "Roll back a reload during its probation",
                                     Lifecycle::ACTION_ROLL_BACK, "reload"),
                    live::add_change(*group, "confirm", "Accept a reload and end its probation",
                                     Lifecycle::ACTION_CONFIRM, "reload")}};
}

}  // namespace fastcycle::tool
