#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include "archive/message_text.h"
#include "archive/message_type.h"
#include "archive/readable.h"
#include "base/printable.h"
#include "command.h"
#include "file_work.h"
#include "mcap/reader.h"
#include "mcap/topic_filter.h"
#include "print.h"
#include "quantity.h"
#include "rewriting.h"

namespace fastcycle::tool {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kIndent = 2;

struct EchoOptions {
  std::filesystem::path file;
  std::vector<std::string> patterns;
  std::string start;
  std::string end;
  std::optional<std::uint64_t> count;
  bool is_full = false;
  bool is_json = false;
};

std::string publisher_of(const mcap::Channel& channel) {
  const auto found = channel.metadata.find("publisher");
  return found == channel.metadata.end() ? "" : found->second;
}

/// Prints messages.
class Echo {
 public:
  Echo(const mcap::Reader& reader, const EchoOptions& options)
      : reader_(reader),
        is_json_(options.is_json),
        limits_(options.is_full ? archive::TextLimits::none() : archive::TextLimits{}) {}

  [[nodiscard]] std::string text_of(const mcap::StoredMessage& message) {
    return is_json_ ? json(message) : text(message);
  }

 private:
  [[nodiscard]] const mcap::Schema* schema_of(const mcap::Channel& channel) const {
    return reader_.definitions().find_schema(channel.schema_id);
  }

  /// The message; null, with the reason, if it cannot be read.
  std::unique_ptr<google::protobuf::Message> parse(const mcap::StoredMessage& message,
                                                   std::string& problem) {
    const mcap::Schema* const schema = schema_of(*message.channel);
    if (schema == nullptr) {
      problem = "it has no schema";
      return nullptr;
    }
    const archive::MessageTypes::Found& found = types_.find(*schema);
    problem = found.problem;
    if (found.type == nullptr) {
      return nullptr;
    }
    try {
      return found.type->parse(message.data);
    } catch (const std::runtime_error& error) {
      problem = error.what();
      return nullptr;
    }
  }

  std::string text(const mcap::StoredMessage& message) {
    const mcap::Channel& channel = *message.channel;
    std::string text = fmt::format("{}  {}  #{}", utc_text(message.log_time_ns),
                                   archive::printable(channel.topic), message.sequence);
    const std::string publisher = publisher_of(channel);
    text += (publisher.empty() ? "" : "  " + archive::printable(publisher)) + "\n";
    const std::string indent(kIndent, ' ');
    if (channel.message_encoding == "json") {
      return text + indent + archive::printable(mcap::text_of(message.data)) + "\n";
    }
    std::string problem;
    if (channel.message_encoding == "protobuf") {
      if (const auto parsed = parse(message, problem)) {
        return text + archive::to_text(*parsed, limits_, kIndent);
      }
      text += indent + "cannot be read: " + archive::printable(problem) + "\n";
    }
    return text + indent + archive::to_hex(message.data, limits_) + "\n";
  }

  std::string json(const mcap::StoredMessage& message) {
    const mcap::Channel& channel = *message.channel;
    const mcap::Schema* const schema = schema_of(channel);
    Json json{{"log_time_ns", message.log_time_ns},
              {"publish_time_ns", message.publish_time_ns},
              {"topic", channel.topic},
              {"sequence", message.sequence},
              {"publisher", publisher_of(channel)},
              {"type", schema == nullptr ? "" : schema->name},
              {"encoding", channel.message_encoding}};
    add_data(message, json);
    return base::printable_json(json.dump(-1, ' ', false, Json::error_handler_t::replace)) + "\n";
  }

  void add_data(const mcap::StoredMessage& message, Json& json) {
    const std::string& encoding = message.channel->message_encoding;
    std::string problem;
    if (encoding == "protobuf") {
      const auto parsed = parse(message, problem);
      if (parsed != nullptr && add_protobuf(*parsed, json, problem)) {
        return;
      }
      json["problem"] = problem;
    } else if (encoding == "json") {
      Json data = Json::parse(mcap::text_of(message.data), nullptr, false);
      if (!data.is_discarded()) {
        json["data"] = std::move(data);
        return;
      }
      json["problem"] = "its data is no JSON";
    }
    json["data_hex"] = archive::to_hex(message.data, limits_);
  }

  bool add_protobuf(const google::protobuf::Message& message, Json& json, std::string& problem) {
    try {
      const archive::MessageJson data = archive::to_json(message, limits_);
      json["data"] = Json::parse(data.data);
      for (const archive::Elided& elided : data.elided) {
        json["elided"].push_back({{"field", elided.field}, {"left_out", elided.left_out}});
      }
      return true;
    } catch (const std::exception& error) {
      problem = error.what();
      return false;
    }
  }

  const mcap::Reader& reader_;
  const bool is_json_;
  const archive::TextLimits limits_;
  archive::MessageTypes types_;
};

/// The topics that the patterns mean; all without any.
std::vector<std::string> topics_of(const mcap::Reader& reader,
                                   const std::vector<std::string>& patterns) {
  std::vector<std::string> topics;
  const mcap::TopicFilter filter{.topics = patterns, .except = {}};
  for (const auto& [id, channel] : reader.definitions().channels()) {
    if (filter.wants(channel.topic) && std::ranges::find(topics, channel.topic) == topics.end()) {
      topics.push_back(channel.topic);
    }
  }
  return topics;
}

int print(const mcap::Reader& reader, mcap::MessageQuery query, const EchoOptions& options) {
  Output output;
  Echo echo(reader, options);
  mcap::MessageReader messages = reader.messages(std::move(query));
  for (std::uint64_t given = 0; !options.count || given < *options.count; ++given) {
    const std::optional<mcap::StoredMessage> message = messages.next();
    if (!message) {
      break;
    }
    if (!output.write(echo.text_of(*message))) {
      return kDone;
    }
  }
  output.flush();
  return kDone;
}

int echo(const EchoOptions& options) {
  std::optional<std::uint64_t> start_ns;
  std::optional<std::uint64_t> end_ns;
  std::string wrong = read_offset("--start", options.start, start_ns);
  wrong = wrong.empty() ? read_offset("--end", options.end, end_ns) : wrong;
  if (!wrong.empty()) {
    return print_error("echo", wrong);
  }
  const mcap::FileSource source(options.file);
  const mcap::Reader reader(source);
  archive::require_messages(reader.problem(), reader.statistics()->message_count);
  mcap::MessageQuery query{.topics = topics_of(reader, options.patterns)};
  if (query.topics.empty() && !options.patterns.empty()) {
    print_to(stderr, "fastcycle echo: no topic of {} matches {}\n", options.file.string(),
             options.patterns.front());
    return kFailed;
  }
  const std::uint64_t first_ns = reader.statistics()->message_start_time_ns;
  query.begin_ns = first_ns + start_ns.value_or(0);
  if (end_ns) {
    query.end_ns = first_ns + *end_ns;
  }
  const int result = print(reader, std::move(query), options);
  if (reader.problem()) {
    print_problem("echo", *reader.problem(), "the messages before it are printed");
  }
  return result;
}

}  // namespace

Command add_echo(CLI::App& program) {
  CLI::App* line = program.add_subcommand("echo", "Print the messages of a log");
  line->footer(
      examples("  fastcycle echo drive.mcap control/speed --count 3\n"
               "  fastcycle echo drive.mcap 'radar/**' --start 10s --end 12s\n"
               "  fastcycle echo drive.mcap --json | jq .data\n"));
  const auto options = std::make_shared<EchoOptions>();
  line->add_option("file", options->file, "The log")->required()->type_name("FILE");
  line->add_option("topics", options->patterns,
                   "Only topics that match: control/* (one level), camera/** (any)")
      ->type_name("TOPIC-PATTERN");
  line->add_option("--count", options->count, "End after this number of messages")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  line->add_option("--start", options->start, "Start time, from the beginning of the log: 10s")
      ->type_name("TIME");
  line->add_option("--end", options->end, "End time, from the beginning of the log: 15s")
      ->type_name("TIME");
  line->add_flag("--full", options->is_full, "Print large fields and long lists in full");
  line->add_flag("--json", options->is_json, "Print one JSON object per line");
  return {line, [options] { return echo(*options); }};
}

}  // namespace fastcycle::tool
