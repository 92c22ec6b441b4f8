#include "archive/rewrite.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <queue>
#include <string>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "archive/progress.h"
#include "archive/readable.h"
#include "log/log.pb.h"
#include "mcap/crc.h"
#include "mcap/decode.h"
#include "mcap/encode.h"
#include "mcap/reader.h"
#include "mcap/writer.h"

namespace fastcycle::archive {
namespace {

constexpr const char* kInfosTopic = "fastcycle/message_infos";
constexpr std::uint64_t kMostInfosBytes = std::uint64_t{16} << 20U;
constexpr std::uint64_t kSmallAttachmentBytes = std::uint64_t{1} << 20U;

[[noreturn]] void fail(const std::string& file, mcap::Opcode record, std::string expected,
                       std::string found) {
  throw mcap::Error({.place = {.file = file},
                     .record = name_of(record),
                     .expected = std::move(expected),
                     .found = std::move(found)});
}

// ---- Schemas and channels of all inputs ----

/// The definitions of the output. Those of the first input keep their numbers.
template <typename Kind>
class Numbering {
 public:
  explicit Numbering(std::uint16_t lowest) : lowest_(lowest) {}

  /// The number of `one` in the output, if an input before `input` has it already.
  [[nodiscard]] std::optional<std::uint16_t> find(Kind one, std::size_t input) const {
    if (input == 0) {
      return {};
    }
    const auto is_same = [&](const auto& entry) {
      one.id = entry.first;
      return entry.second.input < input && entry.second.one == one;
    };
    const auto same_number = all_.find(one.id);
    if (same_number != all_.end() && is_same(*same_number)) {
      return same_number->first;
    }
    const auto found = std::ranges::find_if(all_, is_same);
    return found == all_.end() ? std::nullopt : std::optional(found->first);
  }

  /// Adds it, with the number that it has if that is free.
  std::uint16_t add(Kind one, std::size_t input, const std::string& file) {
    if (all_.contains(one.id)) {
      while (all_.contains(lowest_)) {
        if (++lowest_ == 0) {
          fail(file, mcap::Opcode::kChannel, "at most 65535 different schemas and channels",
               "more");
        }
      }
      one.id = lowest_;
    }
    const std::uint16_t id = one.id;
    all_.emplace(id, Entry{.one = std::move(one), .input = input});
    return id;
  }

  template <typename Take>
  void for_each(const Take& take) const {
    for (const auto& [id, entry] : all_) {
      take(entry.one);
    }
  }

 private:
  struct Entry {
    Kind one;
    std::size_t input = 0;  ///< That has it first.
  };

  std::map<std::uint16_t, Entry> all_;
  std::uint16_t lowest_;  // No number below it is free.
};

using Numbers = std::map<std::uint16_t, std::uint16_t>;

// ---- Inputs ----

struct Input {
  explicit Input(const mcap::Source& the_source) : source(the_source), reader(the_source) {}

  const mcap::Source& source;
  const mcap::Reader reader;
  Numbers channels = {};  ///< From those of the file to those of the output.
  bool keeps_numbers = true;
};

/// Messages of one input, and the next one of them.
struct Stream {
  const Input* input = nullptr;
  std::size_t number = 0;
  mcap::MessageReader messages;
  std::optional<mcap::StoredMessage> next = {};
};

struct IsLater {
  bool operator()(const Stream* left, const Stream* right) const {
    return std::pair(left->next->log_time_ns, left->number) >
           std::pair(right->next->log_time_ns, right->number);
  }
};

// ---- Attachments and metadata ----

std::uint32_t crc_of(mcap::Bytes bytes) {
  mcap::Crc crc;
  crc.add(bytes);
  return crc.value();
}

/// Decides what of several inputs is written: what is the same as often as that one has it that has
/// it most often.
class Once {
 public:
  /// Names a content; two of one key are compared by `is_same`.
  using Key = std::tuple<std::string, std::string, std::uint64_t, std::uint64_t, std::uint64_t,
                         std::uint32_t>;
  /// Which one it is: of this input, in its index.
  struct Which {
    std::size_t input = 0;
    std::size_t index = 0;
  };

  template <typename IsSame>
  bool is_wanted(const Key& key, Which which, const IsSame& is_same) {
    std::vector<Group>& groups = groups_[key];
    for (Group& group : groups) {
      if (is_same(group.first)) {
        group.count = group.last_input == which.input ? group.count + 1 : 1;
        group.last_input = which.input;
        return group.count > std::exchange(group.written, std::max(group.written, group.count));
      }
    }
    if (groups.size() < kMostOfOneKey) {  // CRCs that are equal by chance, or by ill will.
      groups.push_back({.first = which, .last_input = which.input, .count = 1, .written = 1});
    }
    return true;
  }

 private:
  static constexpr std::size_t kMostOfOneKey = 16;
  struct Group {
    Which first;
    std::size_t last_input = 0;
    std::uint64_t count = 0;  ///< In that input.
    std::uint64_t written = 0;
  };
  std::map<Key, std::vector<Group>> groups_;
};

// ---- The whole of it ----

class Rewriter {
 public:
  Rewriter(std::span<const mcap::Source* const> inputs, const NextSink& next_sink,
           const Layout& layout, const Selection& selection, const Progress& progress)
      : next_sink_(next_sink), layout_(layout), selection_(selection), progress_(progress) {
    for (const mcap::Source* source : inputs) {
      inputs_.push_back(std::make_unique<Input>(*source));
      note(*inputs_.back());
    }
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      number(*inputs_[i], i);
    }
    require_few_definitions();
    choose_explanation();
  }

  Rewritten run() {
    open_streams();
    begin_file();
    while (!queue_.empty()) {
      Stream& stream = *queue_.top();
      queue_.pop();
      take(*stream.input, *stream.next);
      stream.next = stream.messages.next();
      if (stream.next) {
        queue_.push(&stream);
      }
    }
    writer_->close();
    return std::move(result_);
  }

 private:
  void note(const Input& input) {
    const auto& statistics = input.reader.statistics();
    require_messages(input.reader.problem(), statistics->message_count);
    if (input.reader.problem()) {
      result_.problems.push_back(*input.reader.problem());
    }
    bytes_in_ += input.source.size();
    if (statistics->message_count > 0) {
      first_ns_ = messages_in_ == 0 ? statistics->message_start_time_ns
                                    : std::min(first_ns_, statistics->message_start_time_ns);
    }
    messages_in_ += statistics->message_count;
    const std::string& profile = input.reader.header().profile;
    profile_ = inputs_.size() == 1 || profile_ == profile ? profile : "";
  }

  [[nodiscard]] bool wants_infos() const {
    return std::ranges::none_of(selection_.topics.except, [](const std::string& pattern) {
      return mcap::matches(pattern, kInfosTopic);
    });
  }

  [[nodiscard]] bool is_wanted(const mcap::Channel& channel) const {
    return selection_.topics.wants(channel.topic) ||
           (channel.topic == kInfosTopic && wants_infos());
  }

  /// Gives numbers to the schemas and channels of an input that are wanted.
  void number(Input& input, std::size_t order) {
    const mcap::Definitions& definitions = input.reader.definitions();
    Numbers schemas{{0, 0}};
    const auto number_schema = [&](const mcap::Schema& schema) {
      const auto [place, is_new] = schemas.try_emplace(schema.id);
      if (is_new) {
        const std::optional<std::uint16_t> known = schemas_.find(schema, order);
        place->second = known ? *known : schemas_.add(schema, order, input.source.name());
      }
    };
    if (selection_.topics.topics.empty() && selection_.topics.except.empty()) {
      for (const auto& [id, schema] : definitions.schemas()) {
        number_schema(schema);
      }
    }
    for (const auto& [id, channel] : definitions.channels()) {
      if (!is_wanted(channel)) {
        continue;
      }
      if (channel.schema_id != 0) {
        number_schema(*definitions.find_schema(channel.schema_id));
      }
      mcap::Channel renumbered = channel;
      renumbered.schema_id = schemas.at(channel.schema_id);
      const std::optional<std::uint16_t> known = channels_.find(renumbered, order);
      const std::uint16_t number =
          known ? *known : channels_.add(std::move(renumbered), order, input.source.name());
      input.channels[id] = number;
      input.keeps_numbers = input.keeps_numbers && number == id;
    }
  }

  void require_few_definitions() {
    schemas_.for_each([&](const mcap::Schema& one) { definition_bytes_ += encoded_size(one); });
    channels_.for_each([&](const mcap::Channel& one) { definition_bytes_ += encoded_size(one); });
    channels_.for_each([&](const mcap::Channel& /*one*/) { end_bytes_ += kEndBytesOfAChannel; });
    if (definition_bytes_ > kMostDefinitionBytes) {
      fail(inputs_.front()->source.name(), mcap::Opcode::kSchema,
           fmt::format("at most {} bytes of schemas and channels", kMostDefinitionBytes),
           fmt::format("{}", definition_bytes_));
    }
  }

  template <typename Kind>
  static std::uint64_t encoded_size(const Kind& one) {
    std::vector<std::byte> bytes;
    mcap::encode(one, bytes);
    return bytes.size();
  }

  void open_streams() {
    for (const auto& input : inputs_) {
      if (selection_.is_everything()) {
        add_stream(*input, {});
        continue;
      }
      const std::uint64_t begin_ns = first_ns_ + selection_.begin_ns;
      mcap::MessageQuery query{.topics = {}, .begin_ns = begin_ns, .end_ns = {}};
      if (selection_.end_ns) {
        query.end_ns = first_ns_ + *selection_.end_ns;
      }
      bool has_infos = false;
      for (const auto& [id, channel] : input->reader.definitions().channels()) {
        if (channel.topic == kInfosTopic) {
          has_infos = input->channels.contains(id);
        } else if (input->channels.contains(id)) {
          query.topics.push_back(channel.topic);
        }
      }
      if (!query.topics.empty()) {
        add_stream(*input, std::move(query));
      }
      if (has_infos) {
        add_stream(*input, {.topics = {kInfosTopic}, .begin_ns = begin_ns, .end_ns = {}});
      }
    }
  }

  void add_stream(const Input& input, mcap::MessageQuery query) {
    streams_.push_back(std::make_unique<Stream>(
        Stream{&input, streams_.size(), input.reader.messages(std::move(query)), {}}));
    Stream& stream = *streams_.back();
    stream.next = stream.messages.next();
    if (stream.next) {
      queue_.push(&stream);
    }
  }

  // ---- Metadata of the messages ----

  void choose_explanation() {
    Once once_attached;
    Once once_listed;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const mcap::Reader& reader = inputs_[i]->reader;
      for (std::size_t k = 0; k < reader.attachments().size(); ++k) {
        if (is_wanted_attachment({i, k}, once_attached)) {
          attachments_.push_back({i, k});
        }
      }
      for (std::size_t k = 0; k < reader.metadata().size(); ++k) {
        if (is_wanted_metadata({i, k}, once_listed)) {
          metadata_.push_back({i, k});
        }
      }
    }
  }

  bool is_wanted_attachment(Once::Which which, Once& once) {
    std::vector<std::byte> memory;
    const mcap::Attachment one = attachment(which, memory);
    const Once::Key key{one.name,           one.media_type,  one.log_time_ns,
                        one.create_time_ns, one.data.size(), crc_of(one.data)};
    return once.is_wanted(key, which, [&](Once::Which before) {
      std::vector<std::byte> other;
      return std::ranges::equal(attachment(before, other).data, one.data);
    });
  }

  bool is_wanted_metadata(Once::Which which, Once& once) {
    const mcap::Metadata one = metadata(which);
    std::vector<std::byte> bytes;
    mcap::encode(one, bytes);
    const Once::Key key{one.name, "", 0, 0, bytes.size(), crc_of(bytes)};
    return once.is_wanted(key, which, [&](Once::Which before) { return metadata(before) == one; });
  }

  mcap::Attachment attachment(Once::Which which, std::vector<std::byte>& memory) const {
    const mcap::Reader& reader = inputs_[which.input]->reader;
    return reader.read(reader.attachments()[which.index], memory);
  }
  mcap::Metadata metadata(Once::Which which) const {
    const mcap::Reader& reader = inputs_[which.input]->reader;
    return reader.read(reader.metadata()[which.index]);
  }

  // ---- Output ----

  void begin_file() {
    if (writer_) {
      writer_->close();
    }
    const bool is_first = result_.files == 0;
    mcap::Sink& sink = next_sink_(++result_.files);
    writer_.emplace(sink, mcap::WriterOptions{.profile = profile_,
                                              .library = "fastcycle",
                                              .chunk_bytes = layout_.chunk_bytes,
                                              .chunk = layout_.chunk,
                                              .message_index = layout_.has_index,
                                              .chunk_index = layout_.has_index});
    count_in_file_ = 0;
    explain(is_first);
    schemas_.for_each([this](const mcap::Schema& schema) { writer_->add(schema); });
    channels_.for_each([this](const mcap::Channel& channel) { writer_->add(channel); });
    writer_->flush();
    written_bytes_ = writer_->size();
    open_bytes_ = 0;
  }

  void explain(bool is_first) {
    for (const Once::Which& which : metadata_) {
      writer_->write(metadata(which));
      require_readable(*writer_, inputs_[which.input]->source.name());
    }
    std::vector<std::byte> memory;
    for (const Once::Which& which : attachments_) {
      const mcap::AttachmentIndex& index = inputs_[which.input]->reader.attachments()[which.index];
      if (is_first || index.data_size <= kSmallAttachmentBytes) {
        writer_->write(attachment(which, memory));
        require_readable(*writer_, inputs_[which.input]->source.name());
      }
    }
  }

  /// Whether the file that is open has no room for one more message.
  [[nodiscard]] bool is_full(const mcap::MessageHead& head, std::uint64_t bytes) const {
    const PieceSize& most = layout_.piece;
    if (count_in_file_ == 0) {
      return false;
    }
    const std::uint64_t size = writer_->size() + writer_->index_bytes() + definition_bytes_ +
                               end_bytes_ + open_bytes_ + kMessageBytes + bytes;
    return (most.bytes > 0 && size > most.bytes) ||
           (most.time_ns > 0 && head.log_time_ns - first_in_file_ns_ >= most.time_ns);
  }

  void take(const Input& input, const mcap::StoredMessage& message) {
    report_progress();
    mcap::MessageHead head = message;
    head.channel_id = input.channels.at(message.channel_id);
    const bool is_infos = message.channel->topic == kInfosTopic;
    if (is_infos && !(input.keeps_numbers && selection_.is_everything())) {
      take_infos(input, message, head);
      return;
    }
    if (!is_infos && !selection_.is_everything()) {
      taken_[head.channel_id].add(message.sequence);
    }
    write(input, head, message.data);
  }

  /// Renumbers channels, and leaves out what is about messages that were not taken.
  void take_infos(const Input& input, const mcap::StoredMessage& message,
                  const mcap::MessageHead& head) {
    log::MessageInfos infos;
    const bool is_right =
        message.data.size() <= kMostInfosBytes &&
        infos.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()));
    if (!is_right) {
      fail(input.source.name(), mcap::Opcode::kMessage,
           fmt::format("a fastcycle.log.MessageInfos of at most {} bytes on {}", kMostInfosBytes,
                       kInfosTopic),
           fmt::format("{} bytes that are none", message.data.size()));
    }
    log::MessageInfos wanted;
    for (const log::MessageInfo& info : infos.infos()) {
      const auto channel = info.channel() > 0xFFFF
                               ? input.channels.end()
                               : input.channels.find(static_cast<std::uint16_t>(info.channel()));
      if (channel == input.channels.end() || !was_taken(channel->second, info.sequence())) {
        continue;
      }
      log::MessageInfo& copy = *wanted.add_infos();
      copy = info;
      copy.set_channel(channel->second);
    }
    if (wanted.infos_size() > 0 || infos.infos_size() == 0) {
      write(input, head, mcap::bytes_of(wanted.SerializeAsString()));
    }
  }

  [[nodiscard]] bool was_taken(std::uint16_t channel, std::uint64_t sequence) const {
    if (selection_.is_everything()) {
      return true;
    }
    const auto range = taken_.find(channel);
    return range != taken_.end() && range->second.has(static_cast<std::uint32_t>(sequence));
  }

  void write(const Input& input, const mcap::MessageHead& head, mcap::Bytes data) {
    if (data.size() > kMostMessageBytes) {
      fail(input.source.name(), mcap::Opcode::kMessage,
           fmt::format("at most {} bytes", kMostMessageBytes), fmt::format("{}", data.size()));
    }
    if (is_full(head, data.size()) && open_bytes_ >= kWorthAChunk) {
      // It is smaller once it is compressed.
      writer_->flush();
      written_bytes_ = writer_->size();
      open_bytes_ = 0;
    }
    if (is_full(head, data.size())) {
      begin_file();
    }
    if (count_in_file_++ == 0) {
      first_in_file_ns_ = head.log_time_ns;
    }
    write_readably(*writer_, head, data);
    require_readable(*writer_, input.source.name());
    open_bytes_ = writer_->size() == written_bytes_ ? open_bytes_ + kMessageBytes + data.size()
                                                    : kMessageBytes + data.size();
    written_bytes_ = writer_->size();
    ++result_.messages;
  }

  void report_progress() {
    if (progress_ && ++given_ % kRecordsPerProgress == 0) {
      progress_(
          static_cast<std::uint64_t>(static_cast<double>(bytes_in_) * static_cast<double>(given_) /
                                     static_cast<double>(messages_in_)));
    }
  }

  /// Overhead of a message: its record, and its index entry.
  static constexpr std::uint64_t kMessageBytes = mcap::kFrameBytes + mcap::kMessageHeadBytes + 16;

  static constexpr std::uint64_t kWorthAChunk = std::uint64_t{64} << 10U;

  // Upper bound of uncounted parts: statistics, offsets, footer, the indexes of one chunk.
  static constexpr std::uint64_t kEndBytes = 1024;
  static constexpr std::uint64_t kEndBytesOfAChannel = 40;

  /// The sequences of the messages that were taken.
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t last = 0;
    bool is_empty = true;

    void add(std::uint32_t sequence) {
      first = is_empty ? sequence : std::min(first, sequence);
      last = is_empty ? sequence : std::max(last, sequence);
      is_empty = false;
    }
    [[nodiscard]] bool has(std::uint32_t sequence) const {
      return !is_empty && sequence >= first && sequence <= last;
    }
  };

  const NextSink& next_sink_;
  const Layout layout_;
  const Selection selection_;
  const Progress& progress_;

  std::vector<std::unique_ptr<Input>> inputs_;
  Numbering<mcap::Schema> schemas_{1};
  Numbering<mcap::Channel> channels_{1};
  std::uint64_t definition_bytes_ = 0;
  std::uint64_t end_bytes_ = kEndBytes;
  std::vector<Once::Which> attachments_;
  std::vector<Once::Which> metadata_;
  std::string profile_;
  std::uint64_t first_ns_ = 0;
  std::uint64_t bytes_in_ = 0;
  std::uint64_t messages_in_ = 0;

  std::vector<std::unique_ptr<Stream>> streams_;
  std::priority_queue<Stream*, std::vector<Stream*>, IsLater> queue_;
  std::map<std::uint16_t, Range> taken_;  // By the channels of the output; of a selection only.
  std::uint64_t given_ = 0;
  Rewritten result_;

  // Of the file that is being written.
  std::optional<mcap::Writer> writer_;
  std::uint64_t count_in_file_ = 0;
  std::uint64_t first_in_file_ns_ = 0;
  std::uint64_t written_bytes_ = 0;
  std::uint64_t open_bytes_ = 0;  // Of messages in the chunk that is open.
};

}  // namespace

Rewritten rewrite(std::span<const mcap::Source* const> inputs, const NextSink& next_sink,
                  const Layout& layout, const Selection& selection, const Progress& progress) {
  return Rewriter(inputs, next_sink, layout, selection, progress).run();
}

}  // namespace fastcycle::archive
