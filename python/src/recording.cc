#include "recording.h"

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "archive/readable.h"
#include "config/nearest.h"
#include "mcap/decode.h"
#include "mcap/error.h"
#include "not_found.h"

namespace fastcycle::python {
namespace {

std::uint64_t begin_of(const Recording::File& file) {
  return file.reader.statistics()->message_start_time_ns;
}

std::string text_of(const mcap::Channel& channel, const char* key) {
  const auto found = channel.metadata.find(key);
  return found == channel.metadata.end() ? "" : found->second;
}

}  // namespace

Recording::Recording(const std::vector<std::filesystem::path>& paths) {
  for (const std::filesystem::path& path : paths) {
    auto file = std::make_unique<File>(path);
    const mcap::Reader& reader = file->reader;
    if (paths.size() == 1) {
      archive::require_messages(reader.problem(), reader.statistics()->message_count);
    }
    const auto begin = [](const auto& one) { return begin_of(*one); };
    const auto place = std::ranges::upper_bound(files_, begin(file), {}, begin);
    files_.insert(place, std::move(file));
  }
  name_ = files_.empty() ? "" : files_.front()->source.name();
  if (files_.size() > 1) {
    name_ += fmt::format(" and {} more", files_.size() - 1);
  }
}

std::vector<std::string> Recording::topics() const {
  std::set<std::string> topics;
  for (const auto& file : files_) {
    for (const auto& [id, channel] : file->reader.definitions().channels()) {
      topics.insert(channel.topic);
    }
  }
  return {topics.begin(), topics.end()};
}

void Recording::require_topic(const std::string& topic) const {
  const std::vector<std::string> known = topics();
  if (!std::ranges::binary_search(known, topic)) {
    throw NotFound(fmt::format("{}: no topic {}; {}", name_, mcap::shown(topic),
                               known.empty() ? "it has none" : config::name_hint(topic, known)));
  }
}

const mcap::Schema& Recording::schema_of(const std::string& topic) const {
  require_topic(topic);
  const auto fail = [&](const File& file, std::string expected, std::string found) {
    throw mcap::Error({.place = {.file = file.source.name()},
                       .expected = std::move(expected) + " on " + mcap::shown(topic),
                       .found = std::move(found)});
  };
  const mcap::Schema* schema = nullptr;
  for (const auto& file : files_) {
    const mcap::Definitions& definitions = file->reader.definitions();
    for (const auto& [id, channel] : definitions.channels()) {
      if (channel.topic != topic) {
        continue;
      }
      const mcap::Schema* const other = definitions.find_schema(channel.schema_id);
      if (channel.message_encoding != "protobuf" || other == nullptr) {
        fail(*file, "messages of protobuf, with a schema,",
             "messages of " + mcap::shown(channel.message_encoding));
      }
      if (schema != nullptr && (other->name != schema->name || other->data != schema->data)) {
        fail(*file, "messages of one type",
             other->name == schema->name
                 ? "two versions of " + mcap::shown(other->name)
                 : mcap::shown(schema->name) + " and " + mcap::shown(other->name));
      }
      schema = schema == nullptr ? other : schema;
    }
  }
  return *schema;
}

Cursor::Cursor(std::shared_ptr<const Recording> recording, mcap::MessageQuery query)
    : recording_(std::move(recording)), query_(std::move(query)) {}

const mcap::StoredMessage* Cursor::next() {
  if (current_ != nullptr) {
    current_->head = current_->messages.next();
    current_ = nullptr;
  }
  for (;;) {
    Stream* const stream = earliest();
    if (stream == nullptr) {
      return nullptr;
    }
    if (!is_repeated(*stream->head)) {
      current_ = stream;
      return &*stream->head;
    }
    stream->head = stream->messages.next();
  }
}

Cursor::Stream* Cursor::earliest() {
  std::erase_if(open_, [](const auto& stream) { return !stream->head; });
  const auto time = [](const auto& stream) { return stream->head->log_time_ns; };
  for (;;) {
    const auto first = std::ranges::min_element(open_, {}, time);
    const bool has_first = first != open_.end();
    const auto& files = recording_->files();
    if (opened_ == files.size() || (has_first && begin_of(*files[opened_]) > time(*first))) {
      return has_first ? first->get() : nullptr;
    }
    open_next_file();
  }
}

void Cursor::open_next_file() {
  const mcap::Reader& reader = recording_->files()[opened_++]->reader;
  auto stream = std::make_unique<Stream>(Stream{.messages = reader.messages(query_)});
  stream->head = stream->messages.next();
  if (stream->head) {
    open_.push_back(std::move(stream));
  }
}

bool Cursor::is_repeated(const mcap::StoredMessage& message) {
  if (recording_->files().size() == 1) {
    return false;
  }
  std::uint32_t*& last = last_of_channel_[message.channel];
  if (last == nullptr) {
    const mcap::Channel& channel = *message.channel;
    last = &last_sequences_[{channel.topic, text_of(channel, "publisher"),
                             text_of(channel, "publisher_id")}];
  }
  // Their lower 32 bits: which one came first, its distance says.
  const bool is_new = static_cast<std::int32_t>(message.sequence - *last) > 0;
  if (!is_new && message.publish_time_ns < message.log_time_ns &&
      message.channel->metadata.contains("publisher")) {
    return true;
  }
  *last = message.sequence;
  return false;
}

}  // namespace fastcycle::python
