// fastcycle record --live: a log of a running application, written by another process.

#include "live/record.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "archive/message_text.h"
#include "base/files.h"
#include "duration.h"
#include "live/text.h"
#include "mcap/writer.h"
#include "print.h"
#include "quantity.h"
#include "record/log_format.h"
#include "record/message_infos.h"

namespace fastcycle::tool::live {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kFlushPeriod{1};
constexpr std::uint16_t kInfosChannel = 1;

/// `name`, or with a number if it is taken.
std::filesystem::path free_name(const std::filesystem::path& name) {
  std::filesystem::path file = name;
  const auto is_taken = [](const std::filesystem::path& path) {
    return std::filesystem::exists(path) || std::filesystem::exists(path.string() + ".active");
  };
  for (unsigned number = 2; is_taken(file); ++number) {
    file = base::numbered(name, number);
  }
  return file;
}

std::uint64_t now_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::nanoseconds(now).count());
}

mcap::Compression compression_of(const std::string& word) {
  return word == "none"   ? mcap::Compression::kNone
         : word == "zstd" ? mcap::Compression::kZstd
                          : mcap::Compression::kLz4;
}

/// A log that is written from what a stream brings.
class LiveLog {
 public:
  LiveLog(std::filesystem::path file, const std::string& compression,
          const protocol::Started& started)
      : file_(std::move(file)),
        sink_(active()),
        writer_(sink_, {.profile = "fastcycle",
                        .library = "fastcycle record --live",
                        .chunk = {.compression = compression_of(compression)}}) {
    explain(started);
    define(started);
    flushed_ = Clock::now();
  }

  void write(const protocol::Messages& messages) {
    std::vector<record::MessageFacts> facts;
    for (const protocol::Message& message : messages.messages()) {
      facts.push_back(write(message));
    }
    write_infos(record::infos_of(facts));
    reported_lost_ += messages.lost();
    flush_if_due();
  }

  void flush_if_due() {
    if (Clock::now() - flushed_ >= kFlushPeriod) {
      writer_.flush();
      require_file();
      flushed_ = Clock::now();
    }
  }

  /// Writes what was lost, and the end; the file then has its name.
  void close(const std::string& why) {
    for (const auto& [name, topic] : topics_) {
      const std::string lost = fmt::format("{}", topic.lost);
      writer_.write(
          mcap::Metadata{.name = "fastcycle.loss",
                         .metadata = {{"topic", name},
                                      {"published", fmt::format("{}", topic.recorded + topic.lost)},
                                      {"recorded", fmt::format("{}", topic.recorded)},
                                      {"lost", lost},
                                      {"lost.overflow", lost}}});
    }
    writer_.write(mcap::Metadata{.name = record::kEndMetadata,
                                 .metadata = {{"end", why},
                                              {"lost", fmt::format("{}", lost())},
                                              {"recorded_by", "fastcycle record --live"}}});
    writer_.close();
    sink_.sync();
    require_file();
    try {
      file_ = base::rename_to_next_free(active(), file_);
    } catch (const std::filesystem::filesystem_error& error) {
      throw Failure(kFailed, active().string() + " contains the log and cannot be renamed to " +
                                 error.path2().string() + ": " + error.code().message());
    }
  }

  [[nodiscard]] std::uint64_t recorded() const { return recorded_; }
  /// Includes losses at the end, which no later message of the publisher reveals.
  [[nodiscard]] std::uint64_t lost() const { return std::max(lost_, reported_lost_); }
  [[nodiscard]] std::uint64_t bytes() const { return writer_.size(); }
  [[nodiscard]] std::size_t topics() const { return topics_.size(); }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  struct Topic {
    std::uint64_t recorded = 0;
    std::uint64_t lost = 0;
  };

  /// The output stream of one publisher's messages.
  struct Stream {
    std::uint16_t channel = 0;
    std::uint64_t publisher = 0;
    Topic* topic = nullptr;
    std::uint64_t last_sequence = 0;
  };

  /// @errors  `Failure` if the recorded file was deleted or moved.
  void require_file() const {
    if (const base::FileState state = sink_.look(); state.kind != base::FileState::Kind::kThere) {
      throw Failure(kFailed, active().string() + ": " + state.words);
    }
  }

  [[nodiscard]] std::filesystem::path active() const { return file_.string() + ".active"; }

  void explain(const protocol::Started& started) {
    std::map<std::string, std::string> facts(started.facts().begin(), started.facts().end());
    facts["recorded_by"] = "fastcycle record --live";
    writer_.write(mcap::Metadata{.name = record::kRunMetadata, .metadata = std::move(facts)});
    if (!started.application_json().empty()) {
      mcap::Attachment attachment;
      attachment.log_time_ns = attachment.create_time_ns = now_ns();
      attachment.name = "application.json";
      attachment.media_type = "application/json";
      attachment.data = mcap::bytes_of(started.application_json());
      writer_.write(attachment);
    }
  }

  void define(const protocol::Started& started) {
    const auto schema = [&](const std::string& type, const std::string& data) {
      const auto id = static_cast<std::uint16_t>(schema_ids_.size() + 1);
      const auto [place, is_new] = schema_ids_.emplace(type, id);
      if (is_new) {
        writer_.add(mcap::Schema{.id = id, .name = type, .encoding = "protobuf", .data = data});
      }
      return place->second;
    };
    const mcap::Schema infos = record::infos_schema(1);
    writer_.add(mcap::Channel{.id = kInfosChannel,
                              .schema_id = schema(infos.name, infos.data),
                              .topic = record::kInfosTopic,
                              .message_encoding = "protobuf",
                              .metadata = {}});
    for (const protocol::Started::Channel& channel : started.channels()) {
      if (channel.schema() >= static_cast<std::uint32_t>(started.schemas_size())) {
        throw Failure(kFailed, "the application did not describe " + channel.topic() + " is");
      }
      const auto id = static_cast<std::uint16_t>(kInfosChannel + 1 + streams_.size());
      writer_.add(mcap::Channel{
          .id = id,
          .schema_id = schema(channel.type(), started.schemas(static_cast<int>(channel.schema()))),
          .topic = channel.topic(),
          .message_encoding = "protobuf",
          .metadata = {{"publisher", channel.component()},
                       {"publisher_id", fmt::format("{:016x}", channel.publisher())}}});
      streams_[channel.channel()] = {
          .channel = id, .publisher = channel.publisher(), .topic = &topics_[channel.topic()]};
    }
  }

  record::MessageFacts write(const protocol::Message& message) {
    const auto found = streams_.find(message.channel());
    if (found == streams_.end()) {
      throw Failure(kFailed, "the application sent a message of an undeclared publisher");
    }
    Stream& stream = found->second;
    const auto time_ns = static_cast<std::uint64_t>(message.publish_time_ns());
    const mcap::Bytes payload = mcap::bytes_of(message.payload());
    writer_.write({.channel_id = stream.channel,
                   .sequence = static_cast<std::uint32_t>(message.sequence()),
                   .log_time_ns = time_ns,
                   .publish_time_ns = time_ns},
                  {&payload, 1});
    last_ns_ = std::max(last_ns_, time_ns);
    ++recorded_;
    ++stream.topic->recorded;
    if (stream.last_sequence != 0 && message.sequence() > stream.last_sequence + 1) {
      const std::uint64_t lost = message.sequence() - stream.last_sequence - 1;
      stream.topic->lost += lost;
      lost_ += lost;
    }
    stream.last_sequence = std::max(stream.last_sequence, message.sequence());
    return {.channel = stream.channel,
            .sequence = message.sequence(),
            .age_ns = message.publish_time_ns() - message.taken_ns(),
            .publisher = stream.publisher,
            .root = message.root(),
            .held = message.held()};
  }

  void write_infos(const std::string& infos) {
    if (infos.empty()) {
      return;
    }
    const mcap::Bytes bytes = mcap::bytes_of(infos);
    writer_.write({.channel_id = kInfosChannel,
                   .sequence = ++infos_written_,
                   .log_time_ns = last_ns_,
                   .publish_time_ns = last_ns_},
                  {&bytes, 1});
  }

  std::filesystem::path file_;
  mcap::FileSink sink_;
  mcap::Writer writer_;
  std::map<std::string, std::uint16_t> schema_ids_;
  std::map<std::string, Topic> topics_;
  std::map<std::uint32_t, Stream> streams_;
  std::uint64_t last_ns_ = 0;
  std::uint64_t recorded_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t reported_lost_ = 0;
  std::uint32_t infos_written_ = 0;
  Clock::time_point flushed_;
};

/// Records until the end, and returns its reason; sets `problem` on an error.
std::string follow(Streams& streams, LiveLog& log, const LiveRecordOptions& options,
                   std::string& problem) {
  const auto begin = Clock::now();
  const auto duration = parse_duration(options.duration);
  std::string why = "stopped on request";
  Output output;
  try {
    streams.follow(
        output,
        [&](const protocol::Answer* answer) {
          if (answer != nullptr && answer->has_messages()) {
            log.write(answer->messages());
          } else if (answer != nullptr && answer->has_ended()) {
            why = streams.is_stopped() ? why : answer->ended().why();
          } else {
            log.flush_if_due();
          }
          if (duration && Clock::now() - begin >= *duration && !streams.is_stopped()) {
            why = "time over";
            streams.stop();
          }
          return true;
        },
        true);
  } catch (const inspect::ClientError& error) {
    problem = error.what();
    why = problem;
  }
  return why;
}

}  // namespace

int record(const LiveRecordOptions& options) {
  if (const std::string wrong = options.record.find_wrong(); !wrong.empty()) {
    throw Failure(kWrong, wrong);
  }
  if (!options.duration.empty() && !parse_duration(options.duration)) {
    throw Failure(kWrong, "--for expects a time above zero with its unit, as 500ms or 10s");
  }
  Session session(options.target, "record --live");
  const protocol::Overview overview = session.overview();
  if (choose(names_of_topics(overview, true), options.record.topics, "topic").empty()) {
    throw Failure(kFailed, "the application has no topics");
  }
  protocol::Request request;
  for (const std::string& topic : options.record.topics) {
    request.mutable_record()->add_topics(topic);
  }
  for (const std::string& topic : options.record.except) {
    request.mutable_record()->add_except(topic);
  }
  request.mutable_record();
  Streams streams(session);
  const protocol::Started started = streams.begin(std::move(request));
  LiveLog log(free_name(options.record.file.empty() ? name_by_time(overview.application())
                                                    : options.record.file),
              options.record.compression, started);
  if (!options.is_quiet) {
    print_to(stderr, "fastcycle record: {} into {}; Ctrl-C ends it\n",
             count_text(log.topics(), "topic"), log.file().string());
  }
  std::string problem;
  const std::string why = follow(streams, log, options, problem);
  log.close(why);
  if (!problem.empty()) {
    throw Failure(kFailed, archive::printable(problem) + "; " + log.file().string() +
                               " contains the messages before that");
  }
  return options.is_quiet
             ? kDone
             : print_text(fmt::format("{}: {} of {}, {}, {} lost; {}\n", log.file().string(),
                                      count_text(log.recorded(), "message"),
                                      count_text(log.topics(), "topic"), bytes_text(log.bytes()),
                                      log.lost(), archive::printable(why)));
}

}  // namespace fastcycle::tool::live
