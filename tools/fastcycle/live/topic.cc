#include "live/topic.h"

#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command.h"
#include "live/session.h"
#include "live/text.h"
#include "mcap/topic_filter.h"
#include "quantity.h"

namespace fastcycle::tool {
namespace live {
namespace {

struct ListOptions {
  Target target;
  std::vector<std::string> patterns;
  bool has_services = false;
};

struct InfoOptions {
  Target target;
  std::string topic;
};

template <typename Ends>
std::string components_text(const Ends& ends) {
  std::string text;
  for (const auto& end : ends) {
    text += (text.empty() ? "" : ", ") + end.component();
  }
  return text.empty() ? "-" : text;
}

/// How many of `count` come in a second, from the start until now.
double rate_hz(std::uint64_t count, std::uint64_t ns) {
  return ns == 0 ? 0.0 : static_cast<double>(count) * 1e9 / static_cast<double>(ns);
}

std::string latency_text(const protocol::Histogram& histogram, double ns) {
  return histogram.count() == 0 ? "-" : span_text(ns);
}

std::string table_of(const std::vector<const protocol::Topic*>& topics, std::uint64_t ns) {
  std::vector<std::vector<std::string>> rows{
      {"topic", "type", "published", "rate", "p50", "p99", "dropped", "from", "to"}};
  for (const protocol::Topic* topic : topics) {
    const protocol::Histogram& latency = topic->latency();
    rows.push_back({topic->name(), topic->type(), fmt::format("{}", topic->published()),
                    rate_text(rate_hz(topic->published(), ns)),
                    latency_text(latency, latency.p50_ns()),
                    latency_text(latency, latency.p99_ns()), fmt::format("{}", topic->dropped()),
                    components_text(topic->publishers()), components_text(topic->subscribers())});
  }
  return table_text(rows);
}

int list(const ListOptions& options) {
  Session session(options.target, "topic list");
  const protocol::Overview overview = session.overview();
  const bool has_services = options.has_services || !options.patterns.empty();
  const mcap::TopicFilter filter{
      .topics = choose(names_of_topics(overview, has_services), options.patterns, "topic"),
      .except = {}};
  std::vector<const protocol::Topic*> topics;
  Json json = Json::array();
  for (const protocol::Topic& topic : overview.topics()) {
    if ((has_services || !topic.is_service()) && filter.wants(topic.name())) {
      topics.push_back(&topic);
      json.push_back(json_of(topic));
    }
  }
  if (options.target.is_json) {
    return print_json(json);
  }
  return print_text(topics.empty() ? "The application has no topics.\n"
                                   : table_of(topics, uptime_ns(overview)));
}

// ---- One topic ----

std::string drops_text(const protocol::Ledger& ledger) {
  std::string text;
  for (const protocol::Drop& drop : ledger.drops()) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", drop.reason(), drop.count());
  }
  return text.empty() ? "0" : text;
}

std::string publishers_text(const protocol::Topic& topic, std::int64_t now_ns) {
  if (topic.publishers().empty()) {
    return "Nobody publishes it.\n";
  }
  std::vector<std::vector<std::string>> rows{{"published by", "messages", "last"}};
  for (const protocol::Publisher& publisher : topic.publishers()) {
    const std::int64_t last_ns = publisher.last_publish_ns();
    rows.push_back(
        {publisher.component() + (publisher.is_external() ? " (from a thread)" : ""),
         fmt::format("{}", publisher.published()),
         last_ns == 0 ? "never" : span_text(static_cast<double>(now_ns - last_ns)) + " ago"});
  }
  return table_text(rows);
}

std::string subscribers_text(const protocol::Topic& topic) {
  if (topic.subscribers().empty()) {
    return "It has no subscribers.\n";
  }
  std::vector<std::vector<std::string>> rows{
      {"subscribed by", "by", "depth", "delivered", "queued", "dropped", "p50", "p99", "max"}};
  for (const protocol::Subscriber& subscriber : topic.subscribers()) {
    const protocol::Ledger& ledger = subscriber.ledger();
    const protocol::Histogram& latency = subscriber.latency();
    rows.push_back(
        {subscriber.component(), subscriber.kind(), fmt::format("{}", subscriber.depth()),
         fmt::format("{}", ledger.delivered()), fmt::format("{}", ledger.queued()),
         drops_text(ledger), latency_text(latency, latency.p50_ns()),
         latency_text(latency, latency.p99_ns()), latency_text(latency, latency.max_ns())});
  }
  std::string text = table_text(rows);
  for (const protocol::Subscriber& subscriber : topic.subscribers()) {
    for (const std::string& reason : subscriber.unmatched()) {
      text += fmt::format("{}: {}\n", subscriber.component(), reason);
    }
  }
  return text;
}

int info(const InfoOptions& options) {
  Session session(options.target, "topic info");
  const protocol::Topic topic = session.topic(options.topic);
  if (options.target.is_json) {
    return print_json(json_of(topic));
  }
  const protocol::Overview overview = session.overview();
  std::string text = fmt::format("{}  {}\n{} published, {}\n", topic.name(), topic.type(),
                                 count_text(topic.published(), "message"),
                                 rate_text(rate_hz(topic.published(), uptime_ns(overview))));
  if (topic.message_bytes() > 0) {
    text += fmt::format("{} a message\n", bytes_text(topic.message_bytes()));
  }
  if (topic.latched() > 0) {
    text += fmt::format("latched: late subscribers receive the last {}\n", topic.latched());
  }
  return print_text(text + "\n" + publishers_text(topic, overview.now_ns()) + "\n" +
                    subscribers_text(topic));
}

}  // namespace

Command add_topic_list(CLI::App& group) {
  CLI::App* line = group.add_subcommand("list", "List topics with their types, rates and losses");
  line->footer(
      examples("  fastcycle topic list\n"
               "  fastcycle topic list 'control/**'\n"
               "  fastcycle topic list --json | jq '.[] | select(.dropped > 0)'\n"
               "\n"
               "rate: since the start, in application time. p50, p99: time from publish to\n"
               "callback, of the slowest subscriber.\n"));
  const auto options = std::make_shared<ListOptions>();
  line->add_option("topics", options->patterns,
                   "Only topics that match: control/* (one level), camera/** (any)")
      ->type_name("PATTERN");
  line->add_flag("--services", options->has_services, "Include the topics of services and actions");
  options->target.add_to(*line);
  return {line, [options] { return guarded("topic list", [&] { return list(*options); }); }};
}

Command add_topic_info(CLI::App& group) {
  CLI::App* line = group.add_subcommand("info", "Show the publishers and subscribers of a topic");
  line->footer(
      examples("  fastcycle topic info control/speed\n"
               "  fastcycle topic info control/speed --json | jq '.subscribers[].ledger'\n"));
  const auto options = std::make_shared<InfoOptions>();
  line->add_option("topic", options->topic, "The topic")->required()->type_name("TOPIC");
  options->target.add_to(*line);
  return {line, [options] { return guarded("topic info", [&] { return info(*options); }); }};
}

}  // namespace live

Command add_topic(CLI::App& program) {
  CLI::App* group =
      program.add_subcommand("topic", "Inspect the topics of a running application, and publish");
  group->require_subcommand(0, 1);
  group->footer(
      examples("  fastcycle topic list\n"
               "  fastcycle topic echo control/speed --count 3\n"
               "  fastcycle topic pub control/speed '{\"mps\": 3.5}' --rate 10\n"));
  return {.line = group,
          .words = {live::add_topic_list(*group), live::add_topic_info(*group),
                    live::add_topic_echo(*group), live::add_topic_hz(*group),
                    live::add_topic_bw(*group), live::add_topic_delay(*group),
                    live::add_topic_pub(*group)}};
}

}  // namespace fastcycle::tool
