#include "record/recording_reader.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "base/clock.h"
#include "log/log.pb.h"
#include "record/log_format.h"

namespace fastcycle::record {
namespace {

/// Times in files are unsigned, and may have any value.
Time to_time(std::uint64_t ns) {
  constexpr auto kLatest = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max() - 1);
  return base::from_ns(static_cast<std::int64_t>(std::min(ns, kLatest)));
}

std::uint64_t to_file_time(Time time) {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(0, base::to_ns(time)));
}

/// The sequence whose lower 32 bits are `low`, near `last`.
std::uint64_t extended(std::uint32_t low, std::uint64_t last) {
  constexpr std::uint64_t kLap = std::uint64_t{1} << 32U;
  const std::uint64_t sequence = last / kLap * kLap + low;
  return sequence + kLap / 2 < last ? sequence + kLap : sequence;
}

std::optional<Time> find_time(const std::map<std::string, std::string>& facts,
                              const std::string& name) {
  const auto found = facts.find(name);
  std::int64_t ns = 0;
  if (found == facts.end()) {
    return std::nullopt;
  }
  const std::string& text = found->second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), ns);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(base::from_ns(ns))
                                                                  : std::nullopt;
}

PublisherId find_publisher_id(const std::map<std::string, std::string>& metadata) {
  const auto found = metadata.find("publisher_id");
  PublisherId id = 0;
  if (found != metadata.end()) {
    std::from_chars(found->second.data(), found->second.data() + found->second.size(), id, 16);
  }
  return id;
}

}  // namespace

struct RecordingReader::File {
  explicit File(const std::filesystem::path& path) : source(path), reader(source) {}

  static std::uint64_t key(std::uint32_t channel, std::uint64_t sequence) {
    return std::uint64_t{channel} << 32U | (sequence & 0xffff'ffffU);
  }

  mcap::FileSource source;
  mcap::Reader reader;
  std::map<std::uint32_t, std::size_t> stream_of;  ///< By channel.
  std::optional<mcap::MessageReader> messages;
  std::optional<mcap::StoredMessage> head;  ///< The next message.
  /// Of messages to come, by channel and the lower 32 bits of the sequence.
  std::unordered_map<std::uint64_t, log::MessageInfo> infos;
};

RecordingReader::RecordingReader(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& path : files) {
    open(path);
  }
  end_ = std::max(end_, begin_);
}

RecordingReader::~RecordingReader() = default;

void RecordingReader::open(const std::filesystem::path& path) {
  files_.push_back(std::make_unique<File>(path));
  File& file = *files_.back();
  if (const auto& problem = file.reader.problem()) {
    notes_.push_back(mcap::to_string(*problem) + "; what is before that is read");
  }
  add_streams(file);
  read_facts(file);
}

void RecordingReader::add_streams(File& file) {
  const auto& counts = file.reader.statistics()->channel_message_counts;
  for (const auto& [id, channel] : file.reader.definitions().channels()) {
    if (channel.topic == kActivationsTopic || channel.topic == kInfosTopic) {
      continue;
    }
    const auto publisher = channel.metadata.find("publisher");
    const std::string name = publisher == channel.metadata.end() ? "" : publisher->second;
    const PublisherId publisher_id = find_publisher_id(channel.metadata);
    auto found = std::ranges::find_if(streams_, [&](const RecordedStream& stream) {
      return stream.topic == channel.topic && stream.publisher == name &&
             stream.publisher_id == publisher_id;
    });
    if (found == streams_.end()) {
      const mcap::Schema* schema = file.reader.definitions().find_schema(channel.schema_id);
      streams_.push_back({.topic = channel.topic,
                          .publisher = name,
                          .publisher_id = publisher_id,
                          .encoding = channel.message_encoding,
                          .type = schema == nullptr ? "" : schema->name,
                          .schema = schema == nullptr ? "" : schema->data});
      found = streams_.end() - 1;
    }
    const auto count = counts.find(id);
    found->messages += count == counts.end() ? 0 : count->second;
    file.stream_of[id] = static_cast<std::size_t>(found - streams_.begin());
  }
}

void RecordingReader::read_facts(const File& file) {
  std::optional<Time> began;
  for (const mcap::MetadataIndex& index : file.reader.metadata()) {
    if (index.name == kRunMetadata) {
      began = find_time(file.reader.read(index).metadata, "start_ns");
    } else if (index.name == kEndMetadata) {
      const mcap::Metadata facts = file.reader.read(index);
      end_ = std::max(end_, find_time(facts.metadata, "time_ns").value_or(end_));
      begin_of_timers_ = find_time(facts.metadata, "timers_ns").value_or(begin_of_timers_);
      end_facts_.insert(facts.metadata.begin(), facts.metadata.end());
    }
  }
  const mcap::Statistics& statistics = *file.reader.statistics();
  if (statistics.message_count > 0) {
    const Time first = to_time(statistics.message_start_time_ns);
    began = began ? std::min(*began, first) : first;
    end_ = std::max(end_, to_time(statistics.message_end_time_ns));
  }
  if (began) {
    begin_ = has_begin_ ? std::min(begin_, *began) : *began;
    has_begin_ = true;
  }
}

void RecordingReader::rewind(Selection selection) {
  selection_ = std::move(selection);
  first_sequences_.assign(streams_.size(), 0);
  last_sequences_.assign(streams_.size(), 0);
  count_ = 0;
  for (const auto& file : files_) {
    file->infos.clear();
    file->head.reset();
    file->messages.reset();
    std::vector<std::string> topics;
    for (const auto& [channel, stream] : file->stream_of) {
      if (selection_.wanted[stream]) {
        topics.push_back(streams_[stream].topic);
      }
    }
    if (!topics.empty()) {
      file->messages.emplace(file->reader.messages({.topics = std::move(topics),
                                                    .begin_ns = to_file_time(selection_.from),
                                                    .end_ns = to_file_time(selection_.to) + 1,
                                                    .heads = {kInfosTopic}}));
      advance(*file);
    }
  }
}

void RecordingReader::advance(File& file) {
  for (;;) {
    file.head = file.messages->next();
    if (!file.head) {
      return;
    }
    const auto stream = file.stream_of.find(file.head->channel_id);
    if (stream != file.stream_of.end() && selection_.wanted[stream->second]) {
      return;  // Other publishers of a topic may not be selected.
    }
    if (file.head->channel->topic == kInfosTopic) {
      take_infos(file, *file.head);
    }
  }
}

void RecordingReader::take_infos(File& file, const mcap::StoredMessage& message) {
  log::MessageInfos infos;
  if (!infos.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    throw mcap::Damage({.place = {.file = file.source.name()},
                        .record = std::string("a message of ") + kInfosTopic,
                        .expected = "fastcycle.log.MessageInfos",
                        .found = fmt::format("{} bytes that are none", message.data.size())});
  }
  drop_parted_infos(file);
  for (log::MessageInfo& info : *infos.mutable_infos()) {
    const auto stream = file.stream_of.find(info.channel());
    if (stream != file.stream_of.end() && selection_.wanted[stream->second]) {
      const std::uint64_t key = File::key(info.channel(), info.sequence());
      file.infos[key] = std::move(info);
    }
  }
}

/// Infos left over belong to messages already returned: they came too late.
void RecordingReader::drop_parted_infos(File& file) {
  std::erase_if(file.infos, [&](const auto& entry) {
    const std::size_t stream = file.stream_of.at(entry.second.channel());
    const bool is_past = entry.second.sequence() <= last_sequences_[stream];
    const bool was_given = is_past && entry.second.sequence() >= first_sequences_[stream];
    parted_infos_ += was_given ? 1 : 0;
    return is_past;
  });
}

RecordingReader::File* RecordingReader::earliest() const {
  File* earliest = nullptr;
  for (const auto& file : files_) {
    if (file->head &&
        (earliest == nullptr || file->head->log_time_ns < earliest->head->log_time_ns)) {
      earliest = file.get();
    }
  }
  return earliest;
}

std::span<RecordedMessage> RecordingReader::next() {
  do {
    count_ = 0;
    File* file = earliest();
    if (file == nullptr) {
      for (const auto& finished : files_) {
        drop_parted_infos(*finished);
      }
      return {};
    }
    const std::uint64_t due_ns = file->head->log_time_ns;
    while (file != nullptr && file->head->log_time_ns == due_ns) {
      take(*file);
      advance(*file);
      file = earliest();
    }
  } while (count_ == 0);  // All were repeated ones.
  const std::span moment(moment_.data(), count_);
  std::ranges::sort(moment, {}, [](const RecordedMessage& message) {
    return std::tuple(message.step, message.stream, message.info.sequence);
  });
  for (const RecordedMessage& message : moment) {
    std::uint64_t& first = first_sequences_[message.stream];
    std::uint64_t& last = last_sequences_[message.stream];
    first = first == 0 ? message.info.sequence : first;
    last = std::max(last, message.info.sequence);
  }
  return moment;
}

void RecordingReader::take(File& file) {
  const mcap::StoredMessage& head = *file.head;
  const std::size_t stream = file.stream_of.at(head.channel_id);
  const bool is_ours = !streams_[stream].publisher.empty();
  const std::uint64_t last = last_sequences_[stream];
  const auto found = file.infos.find(File::key(head.channel_id, head.sequence));
  const bool has_info = found != file.infos.end();
  const log::MessageInfo info = has_info ? std::move(found->second) : log::MessageInfo();
  if (has_info) {
    file.infos.erase(found);
  }
  const std::uint64_t sequence = has_info ? info.sequence() : extended(head.sequence, last);
  // A latched message is repeated at the beginning of each later file.
  if (is_ours && head.publish_time_ns < head.log_time_ns && sequence <= last) {
    return;
  }
  if (count_ == moment_.size()) {
    moment_.emplace_back();
  }
  RecordedMessage& message = moment_[count_++];
  message.stream = stream;
  message.due = to_time(head.log_time_ns);
  message.step = info.has_step() ? info.step() : kUsualStep;
  message.info = {};
  message.info.sequence = is_ours ? sequence : ++last_sequences_[stream];
  message.info.publish_time = is_ours ? to_time(head.publish_time_ns) : message.due;
  message.info.origin = {.taken = message.info.publish_time - Duration(info.age_ns()),
                         .root = info.root(),
                         .held = info.held()};
  message.data.assign(head.data.begin(), head.data.end());
}

}  // namespace fastcycle::record
