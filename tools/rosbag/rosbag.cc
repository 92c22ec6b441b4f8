#include "rosbag/rosbag.h"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "archive/readable.h"
#include "mcap/reader.h"
#include "mcap/writer.h"
#include "record/descriptor_set.h"
#include "ros2/converter.h"
#include "ros2/error.h"
#include "ros2_types/known_types.h"

namespace fastcycle::rosbag {
namespace {

constexpr unsigned kMessagesPerProgress = 256;

bool is_of_ros(const mcap::Channel& channel) {
  return channel.message_encoding == "cdr";
}

/// Bags of other formats are refused, with the tool that makes MCAP of them.
void refuse_other_bags(const mcap::Source& source) {
  for (const auto& [begin, found] :
       {std::pair<std::string_view, const char*>{
            "SQLite format 3", "one in SQLite, as it seems: `ros2 bag convert` makes MCAP of it"},
        {"#ROSBAG V", "one of ROS 1, as it seems: `rosbags-convert` makes one of ROS 2 of it"}}) {
    std::string there(begin.size(), '\0');
    if (source.size() >= there.size()) {
      source.read(0, std::as_writable_bytes(std::span(there)));
    }
    if (there == begin) {
      throw mcap::Error({.place = {.file = source.name()},
                         .record = {},
                         .expected = "a log or a ROS 2 bag, in MCAP",
                         .found = found});
    }
  }
}

/// One channel of the bag.
struct Stream {
  Topic topic;
  const ros2::Converter* type = nullptr;  ///< Null: copied as it is.
  std::unique_ptr<google::protobuf::Message> message = {};
};

class Conversion {
 public:
  Conversion(const mcap::Source& source, mcap::Sink& sink, const archive::Layout& layout)
      : source_(source),
        reader_(source),
        writer_(sink, {.profile = {},
                       .library = "fastcycle",
                       .chunk_bytes = layout.chunk_bytes,
                       .chunk = layout.chunk,
                       .message_index = layout.has_index,
                       .chunk_index = layout.has_index}) {}

  Converted run(const archive::Progress& progress) {
    copy_explanation();
    for (const auto& [id, channel] : reader_.definitions().channels()) {
      add(channel);
    }
    const double total =
        static_cast<double>(std::max<std::uint64_t>(1, reader_.statistics()->message_count));
    std::uint64_t given = 0;
    mcap::MessageReader messages = reader_.messages();
    while (const std::optional<mcap::StoredMessage> message = messages.next()) {
      if (progress && ++given % kMessagesPerProgress == 0) {
        progress(static_cast<std::uint64_t>(static_cast<double>(source_.size()) *
                                            static_cast<double>(given) / total));
      }
      take(*message);
    }
    writer_.close();
    return result();
  }

 private:
  void copy_explanation() {
    for (const mcap::MetadataIndex& index : reader_.metadata()) {
      writer_.write(reader_.read(index));
      archive::require_readable(writer_, source_.name());
    }
    std::vector<std::byte> memory;
    for (const mcap::AttachmentIndex& index : reader_.attachments()) {
      writer_.write(reader_.read(index, memory));
      archive::require_readable(writer_, source_.name());
    }
  }

  void add(const mcap::Channel& channel) {
    const mcap::Definitions& definitions = reader_.definitions();
    const mcap::Schema* schema =
        channel.schema_id == 0 ? nullptr : definitions.find_schema(channel.schema_id);
    Stream& stream = streams_[channel.id];
    stream.topic.name = channel.topic;
    stream.topic.type = schema == nullptr ? "" : schema->name;
    if (is_of_ros(channel) && schema != nullptr) {
      stream.type = types_.try_find(schema->name);
    }
    mcap::Channel out = channel;
    if (stream.type != nullptr) {
      stream.topic.is_converted = true;
      stream.message.reset(stream.type->prototype().New());
      if (out.topic.size() > 1 && out.topic.starts_with('/')) {
        out.topic.erase(0, 1);
      }
      out.message_encoding = "protobuf";
      out.schema_id = schema_of(*stream.type);
      out.metadata["ros_type"] = schema->name;
    } else if (schema != nullptr) {
      writer_.add(*schema);
    }
    writer_.add(out);
  }

  /// The id of the schema of our messages.
  std::uint16_t schema_of(const ros2::Converter& type) {
    const auto [place, is_new] = schemas_.try_emplace(&type);
    if (is_new) {
      const auto& taken = reader_.definitions().schemas();
      while (next_schema_ != 0 && taken.contains(next_schema_)) {
        ++next_schema_;
      }
      if (next_schema_ == 0) {
        throw mcap::Error({.place = {.file = source_.name()},
                           .record = "Schema",
                           .expected = "a number that no schema has",
                           .found = "all 65535 taken"});
      }
      const google::protobuf::Descriptor& descriptor = *type.prototype().GetDescriptor();
      place->second = next_schema_++;
      writer_.add({.id = place->second,
                   .name = descriptor.full_name(),
                   .encoding = "protobuf",
                   .data = record::descriptor_set_of(descriptor)});
    }
    return place->second;
  }

  void take(const mcap::StoredMessage& message) {
    Stream& stream = streams_.at(message.channel_id);
    ++stream.topic.messages;
    if (stream.type == nullptr) {
      write(message, message.data);
      return;
    }
    try {
      stream.type->to_message(message.data, *stream.message);
    } catch (const ros2::CdrError& error) {
      if (stream.topic.unreadable++ == 0) {
        std::string_view what = error.what();  // It begins with the type, which is already printed.
        if (const std::string& type = stream.type->definition().name; what.starts_with(type)) {
          what.remove_prefix(std::min(type.size() + 2, what.size()));
        }
        stream.topic.error = fmt::format("message {}: {}", stream.topic.messages, what);
      }
      return;
    }
    if (stream.message->ByteSizeLong() > archive::kMostMessageBytes) {
      if (stream.topic.unreadable++ == 0) {
        stream.topic.error =
            fmt::format("message {}: expected at most {} bytes, found {}", stream.topic.messages,
                        archive::kMostMessageBytes, stream.message->ByteSizeLong());
      }
      return;
    }
    stream.message->SerializeToString(&serialized_);
    write(message, std::as_bytes(std::span(serialized_)));
  }

  void write(const mcap::MessageHead& head, mcap::Bytes data) {
    if (data.size() > archive::kMostMessageBytes) {
      throw mcap::Error({.place = {.file = source_.name()},
                         .record = "Message",
                         .expected = fmt::format("at most {} bytes", archive::kMostMessageBytes),
                         .found = fmt::format("{}", data.size())});
    }
    archive::write_readably(writer_, head, data);
    archive::require_readable(writer_, source_.name());
    ++written_;
  }

  Converted result() {
    Converted result;
    result.messages = written_;
    for (auto& [id, stream] : streams_) {
      result.topics.push_back(std::move(stream.topic));
    }
    std::ranges::sort(result.topics, [](const Topic& left, const Topic& right) {
      return std::tie(left.name, left.type, left.messages) <
             std::tie(right.name, right.type, right.messages);
    });
    if (reader_.problem()) {
      result.problems.push_back(*reader_.problem());
    }
    return result;
  }

  const mcap::Source& source_;
  const mcap::Reader reader_;
  mcap::Writer writer_;
  ros2::KnownTypes types_;
  std::map<std::uint16_t, Stream> streams_;  // By channel.
  std::map<const ros2::Converter*, std::uint16_t> schemas_;
  std::uint16_t next_schema_ = 1;
  std::uint64_t written_ = 0;
  std::string serialized_;
};

}  // namespace

bool is_rosbag(const mcap::Source& source) {
  refuse_other_bags(source);
  const mcap::Reader reader(source);
  return std::ranges::any_of(reader.definitions().channels(),
                             [](const auto& entry) { return is_of_ros(entry.second); });
}

Converted convert(const mcap::Source& source, mcap::Sink& sink, const archive::Layout& layout,
                  const archive::Progress& progress) {
  return Conversion(source, sink, layout).run(progress);
}

}  // namespace fastcycle::rosbag
