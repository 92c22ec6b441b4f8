#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/message.h>

#include "archive/message_text.h"
#include "archive/message_type.h"
#include "command.h"
#include "live/session.h"
#include "live/text.h"
#include "live/topic.h"
#include "option_values.h"
#include "quantity.h"

namespace fastcycle::tool::live {
namespace {

constexpr int kIndent = 2;

struct EchoOptions {
  Target target;
  std::vector<std::string> patterns;
  std::optional<std::uint64_t> count;
  bool is_once = false;
  bool is_full = false;
  double max_rate_hz = 0.0;
};

/// One topic whose messages come.
class EchoedTopic {
 public:
  EchoedTopic(protocol::Started started, const EchoOptions& options)
      : started_(std::move(started)),
        is_json_(options.target.is_json),
        limits_(options.is_full ? archive::TextLimits::none() : archive::TextLimits{}) {}

  void lose(std::uint64_t count) { lost_ += count; }

  std::string text_of(const protocol::Message& message) {
    const protocol::Started::Channel& channel = channel_of(message.channel());
    return is_json_ ? json(message, channel) : text(message, channel);
  }

 private:
  [[nodiscard]] const protocol::Started::Channel& channel_of(std::uint32_t number) const {
    for (const protocol::Started::Channel& channel : started_.channels()) {
      if (channel.channel() == number) {
        return channel;
      }
    }
    throw Failure(kFailed, "the application sent a message of an undeclared publisher");
  }

  [[nodiscard]] const archive::MessageType& type_of(const protocol::Started::Channel& channel) {
    std::unique_ptr<archive::MessageType>& type = types_[channel.schema()];
    if (type == nullptr) {
      mcap::Schema schema{.id = 1, .name = channel.type(), .encoding = "protobuf", .data = {}};
      if (channel.schema() < static_cast<std::uint32_t>(started_.schemas_size())) {
        schema.data = started_.schemas(static_cast<int>(channel.schema()));
      }
      type = std::make_unique<archive::MessageType>(schema);
    }
    return *type;
  }

  static std::vector<archive::Elided> cut_of(const protocol::Message& message) {
    std::vector<archive::Elided> cut;
    for (const protocol::Elision& elision : message.elisions()) {
      cut.push_back({.field = elision.name(), .left_out = elision.size() - elision.kept()});
    }
    return cut;
  }

  std::string text(const protocol::Message& message, const protocol::Started::Channel& channel) {
    std::string text;
    if (const std::uint64_t lost = std::exchange(lost_, 0); lost > 0) {
      text = fmt::format("({} of {} exceeded the rate at which they can be sent)\n",
                         count_text(lost, "message"), archive::printable(channel.topic()));
    }
    text += fmt::format("{}  {}  #{}  {}\n",
                        utc_text(static_cast<std::uint64_t>(message.publish_time_ns())),
                        archive::printable(channel.topic()), message.sequence(),
                        archive::printable(channel.component()));
    try {
      const auto parsed = type_of(channel).parse(mcap::bytes_of(message.payload()));
      return text + archive::to_text(*parsed, limits_, kIndent, cut_of(message));
    } catch (const std::runtime_error& error) {
      return text + fmt::format("  cannot be read: {}\n", archive::printable(error.what()));
    }
  }

  std::string json(const protocol::Message& message, const protocol::Started::Channel& channel) {
    Json json{{"topic", channel.topic()},
              {"type", channel.type()},
              {"publisher", channel.component()},
              {"sequence", message.sequence()},
              {"publish_time_ns", message.publish_time_ns()},
              {"taken_ns", message.taken_ns()}};
    if (const std::uint64_t lost = std::exchange(lost_, 0); lost > 0) {
      json["lost_before"] = lost;
    }
    try {
      const auto parsed = type_of(channel).parse(mcap::bytes_of(message.payload()));
      const archive::MessageJson data = archive::to_json(*parsed, limits_, cut_of(message));
      json["data"] = Json::parse(data.data);
      for (const archive::Elided& elided : data.elided) {
        json["elided"].push_back({{"field", elided.field}, {"left_out", elided.left_out}});
      }
    } catch (const std::runtime_error& error) {
      json["problem"] = error.what();
    }
    return json_line(json);
  }

  const protocol::Started started_;
  const bool is_json_;
  const archive::TextLimits limits_;
  std::map<std::uint32_t, std::unique_ptr<archive::MessageType>> types_;
  std::uint64_t lost_ = 0;
};

int echo(const EchoOptions& options) {
  Session session(options.target, "topic echo");
  const auto topics = choose(names_of_topics(session.overview(), true), options.patterns, "topic");
  Output output;
  Streams streams(session);
  std::map<std::uint32_t, std::unique_ptr<EchoedTopic>> echoed;
  for (const std::string& topic : topics) {
    protocol::Request request;
    protocol::Stream& stream = *request.mutable_stream();
    stream.set_topic(topic);
    stream.set_content(options.is_full ? protocol::Stream::CONTENT_FULL
                                       : protocol::Stream::CONTENT_ELIDED);
    stream.set_max_rate_hz(options.max_rate_hz);
    std::uint32_t id = 0;
    protocol::Started started = streams.begin(std::move(request), &id);
    echoed.emplace(id, std::make_unique<EchoedTopic>(std::move(started), options));
  }
  std::uint64_t left = options.is_once ? 1 : options.count.value_or(UINT64_MAX);
  streams.follow(output, [&](const protocol::Answer* answer) {
    if (answer == nullptr || !answer->has_messages()) {
      return left > 0;
    }
    EchoedTopic& topic = *echoed.at(answer->id());
    topic.lose(answer->messages().lost());
    for (const protocol::Message& message : answer->messages().messages()) {
      if (left == 0 || !output.write(topic.text_of(message))) {
        return false;
      }
      --left;
    }
    return left > 0;
  });
  output.flush();
  return kDone;
}

}  // namespace

Command add_topic_echo(CLI::App& group) {
  CLI::App* line = group.add_subcommand("echo", "Print messages as they are published");
  line->footer(
      examples("  fastcycle topic echo control/speed\n"
               "  fastcycle topic echo 'radar/**' --count 10\n"
               "  fastcycle topic echo lidar/points --once --full\n"
               "  fastcycle topic echo imu/data --max-rate 2\n"
               "  fastcycle topic echo control/speed --json | jq .data.mps\n"
               "\n"
               "Ctrl-C ends it.\n"));
  const auto options = std::make_shared<EchoOptions>();
  line->add_option("topics", options->patterns,
                   "The topics: a name, control/* (one level), camera/**")
      ->required()
      ->type_name("TOPIC-PATTERN");
  CLI::Option* count =
      line->add_option("--count", options->count, "End after this number of messages")
          ->check(is_above_zero())
          ->type_name("N");
  line->add_flag("--once", options->is_once, "End after one message")->excludes(count);
  line->add_flag("--full", options->is_full, "Print large fields and long lists in full");
  line->add_option("--max-rate", options->max_rate_hz,
                   "Maximum number of messages per topic and second; others are omitted")
      ->check(is_above_zero())
      ->type_name("HZ");
  options->target.add_to(*line, "Print one JSON object per line");
  return {line, [options] { return guarded("topic echo", [&] { return echo(*options); }); }};
}

}  // namespace fastcycle::tool::live
