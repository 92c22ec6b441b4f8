#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <google/protobuf/message.h>

#include "archive/message_text.h"
#include "archive/message_type.h"
#include "command.h"
#include "live/message.h"
#include "live/session.h"
#include "live/text.h"
#include "live/topic.h"
#include "option_values.h"

namespace fastcycle::tool::live {
namespace {

using Clock = std::chrono::steady_clock;

struct PubOptions {
  Target target;
  std::string topic;
  std::string json;
  std::optional<double> rate_hz;
  std::optional<std::uint64_t> count;
};

int publish(const PubOptions& options) {
  Session session(options.target, "topic pub");
  const protocol::Topic topic = session.topic(options.topic);
  const archive::MessageType type(
      {.id = 1, .name = topic.type(), .encoding = "protobuf", .data = topic.schema()});
  const std::string message = serialized_from_json(type, options.json);
  const std::uint64_t wanted = options.count.value_or(options.rate_hz ? UINT64_MAX : 1);
  const auto period = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(1.0 / options.rate_hz.value_or(1.0)));
  const Streams signals(session);
  std::uint64_t published = 0;
  for (auto next = Clock::now(); published < wanted && !signals.is_stopped();) {
    protocol::Request request;
    request.mutable_publish()->set_topic(options.topic);
    request.mutable_publish()->set_message(message);
    session.client().ask(std::move(request));
    ++published;
    next += period;
    while (published < wanted && !signals.is_stopped() && Clock::now() < next) {
      std::this_thread::sleep_until(std::min(next, Clock::now() + std::chrono::milliseconds(50)));
    }
  }
  if (options.target.is_json) {
    return print_json({{"topic", options.topic}, {"published", published}});
  }
  return print_text(fmt::format("{} published on {}\n", count_text(published, "message"),
                                archive::printable(options.topic)));
}

}  // namespace

Command add_topic_pub(CLI::App& group) {
  CLI::App* line = group.add_subcommand("pub", "Publish a message on a topic");
  line->footer(examples(
      "  fastcycle topic pub control/speed '{\"mps\": 3.5}'\n"
      "  fastcycle topic pub control/speed '{\"mps\": 3.5}' --rate 10\n"
      "  fastcycle topic pub control/speed '{}' --rate 100 --count 500\n"
      "\n"
      "Publishes once, or with --rate until Ctrl-C. Omitted fields have their defaults. The\n"
      "application must allow it: \"inspect\": {\"allow\": [\"publish\"]}.\n"));
  const auto options = std::make_shared<PubOptions>();
  line->add_option("topic", options->topic, "The topic")->required()->type_name("TOPIC");
  line->add_option("message", options->json, "The message, as JSON")->required()->type_name("JSON");
  line->add_option("--rate", options->rate_hz, "Messages per second")
      ->check(is_above_zero())
      ->type_name("HZ");
  line->add_option("--count", options->count, "Number of messages")
      ->check(is_above_zero())
      ->type_name("N");
  options->target.add_to(*line);
  return {line, [options] { return guarded("topic pub", [&] { return publish(*options); }); }};
}

}  // namespace fastcycle::tool::live
