#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "conformance.h"
#include "mcap/writer.h"

namespace fastcycle::conformance {
namespace {

using Json = nlohmann::json;

/// A value of the description, and where it stands.
class Node {
 public:
  Node(const Json& json, std::string path) : json_(json), path_(std::move(path)) {}

  [[noreturn]] void fail(const std::string& expected) const {
    throw std::runtime_error(path_ + ": expected " + expected + ", found " +
                             json_.dump(-1, ' ', true, Json::error_handler_t::replace));
  }

  [[nodiscard]] std::string text() const {
    if (!json_.is_string()) {
      fail("a text");
    }
    return json_.get<std::string>();
  }

  template <typename Number = std::uint64_t>
  [[nodiscard]] Number number() const {
    const std::string digits = json_.is_string() ? json_.get<std::string>() : "";
    Number value = 0;
    const char* const end = digits.data() + digits.size();
    const auto [stop, error] = std::from_chars(digits.data(), end, value);
    if (digits.empty() || error != std::errc{} || stop != end) {
      fail("a whole number from 0 to " + std::to_string(std::numeric_limits<Number>::max()) +
           ", as a text");
    }
    return value;
  }

  [[nodiscard]] std::string bytes() const {
    std::string result;
    for (const Node& byte : list()) {
      result += static_cast<char>(byte.number<std::uint8_t>());
    }
    return result;
  }

  [[nodiscard]] std::map<std::string, std::string> texts() const {
    if (!json_.is_object()) {
      fail("an object of texts");
    }
    std::map<std::string, std::string> result;
    for (const auto& [key, value] : json_.items()) {
      result.emplace(key, Node(value, path_ + "/" + key).text());
    }
    return result;
  }

  [[nodiscard]] std::vector<Node> list() const {
    if (!json_.is_array()) {
      fail("a list");
    }
    std::vector<Node> result;
    for (std::size_t i = 0; i < json_.size(); ++i) {
      result.emplace_back(json_[i], path_ + "/" + std::to_string(i));
    }
    return result;
  }

  [[nodiscard]] Node member(const std::string& name) const {
    if (!json_.is_object() || !json_.contains(name)) {
      fail("an object with \"" + name + "\"");
    }
    return {json_.at(name), path_ + "/" + name};
  }

  /// The value of a pair in a list of pairs of name and value.
  [[nodiscard]] Node field(const std::string& name) const {
    for (const Node& pair : member("fields").list()) {
      const std::vector<Node> parts = pair.list();
      if (parts.size() == 2 && parts[0].text() == name) {
        return parts[1];
      }
    }
    fail("a record with the field \"" + name + "\"");
  }

 private:
  const Json& json_;
  std::string path_;
};

mcap::WriterOptions options_of(const Node& features) {
  // The suite's own writers have nothing to choose but these.
  mcap::WriterOptions options{.chunked = false,
                              .chunk_bytes = std::numeric_limits<std::uint64_t>::max(),
                              .message_index = false,
                              .repeat_schemas = false,
                              .repeat_channels = false,
                              .statistics = false,
                              .metadata_index = false,
                              .attachment_index = false,
                              .chunk_index = false,
                              .summary_offsets = false};
  const std::map<std::string, bool*> switches{
      {"ch", &options.chunked},          {"mx", &options.message_index},
      {"st", &options.statistics},       {"rsh", &options.repeat_schemas},
      {"rch", &options.repeat_channels}, {"ax", &options.attachment_index},
      {"mdx", &options.metadata_index},  {"chx", &options.chunk_index},
      {"sum", &options.summary_offsets}};
  for (const Node& feature : features.list()) {
    const auto found = switches.find(feature.text());
    if (feature.text() == "pad") {
      feature.fail("a feature that can be written (\"pad\" is for readers only)");
    }
    if (found == switches.end()) {
      feature.fail("one of ch, mx, st, rsh, rch, ax, mdx, chx, sum");
    }
    *found->second = true;
  }
  return options;
}

void write_record(const Node& record, mcap::Writer& writer) {
  const std::string type = record.member("type").text();
  if (type == "Schema") {
    writer.add(mcap::Schema{.id = record.field("id").number<std::uint16_t>(),
                            .name = record.field("name").text(),
                            .encoding = record.field("encoding").text(),
                            .data = record.field("data").bytes()});
  } else if (type == "Channel") {
    writer.add(mcap::Channel{.id = record.field("id").number<std::uint16_t>(),
                             .schema_id = record.field("schema_id").number<std::uint16_t>(),
                             .topic = record.field("topic").text(),
                             .message_encoding = record.field("message_encoding").text(),
                             .metadata = record.field("metadata").texts()});
  } else if (type == "Message") {
    const std::string data = record.field("data").bytes();
    const mcap::MessageHead head{.channel_id = record.field("channel_id").number<std::uint16_t>(),
                                 .sequence = record.field("sequence").number<std::uint32_t>(),
                                 .log_time_ns = record.field("log_time").number(),
                                 .publish_time_ns = record.field("publish_time").number()};
    writer.write(mcap::Message{head, mcap::bytes_of(data)});
  } else if (type == "Attachment") {
    const std::string data = record.field("data").bytes();
    const mcap::AttachmentHead head{.log_time_ns = record.field("log_time").number(),
                                    .create_time_ns = record.field("create_time").number(),
                                    .name = record.field("name").text(),
                                    .media_type = record.field("media_type").text()};
    writer.write(mcap::Attachment{head, mcap::bytes_of(data)});
  } else if (type == "Metadata") {
    writer.write(mcap::Metadata{.name = record.field("name").text(),
                                .metadata = record.field("metadata").texts()});
  } else {
    record.member("type").fail("Schema, Channel, Message, Attachment, Metadata or DataEnd");
  }
}

}  // namespace

void write_file(const Json& description, mcap::Sink& sink) {
  const Node root(description, "");
  mcap::WriterOptions options =
      options_of(root.member("meta").member("variant").member("features"));
  const std::vector<Node> records = root.member("records").list();
  if (records.empty() || records.front().member("type").text() != "Header") {
    root.member("records").fail("a list that begins with a Header");
  }
  options.profile = records.front().field("profile").text();
  options.library = records.front().field("library").text();

  mcap::Writer writer(sink, options);
  for (const Node& record : std::span(records).subspan(1)) {
    if (record.member("type").text() == "DataEnd") {
      writer.close();
      return;
    }
    write_record(record, writer);
  }
  root.member("records").fail("a list with a DataEnd");
}

}  // namespace fastcycle::conformance
