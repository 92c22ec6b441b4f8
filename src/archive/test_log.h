#pragma once

#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

#include "archive/message_type.h"
#include "archive/rewrite.h"
#include "mcap/test_file.h"

/// A small language for tests: logs with messages of a type that is not compiled in.
namespace fastcycle::archive {

/// Two files, the second imports the first.
inline constexpr const char* kSceneFiles = R"(
  file {
    name: "point.proto" package: "demo" syntax: "proto3"
    message_type {
      name: "Point"
      field { name: "x" number: 1 type: TYPE_DOUBLE label: LABEL_OPTIONAL }
      field { name: "y" number: 2 type: TYPE_DOUBLE label: LABEL_OPTIONAL }
    }
  }
  file {
    name: "scene.proto" package: "demo" syntax: "proto3" dependency: "point.proto"
    message_type {
      name: "Scene"
      field { name: "name" number: 1 type: TYPE_STRING label: LABEL_OPTIONAL }
      field { name: "origin" number: 2 type: TYPE_MESSAGE type_name: ".demo.Point"
              label: LABEL_OPTIONAL }
      field { name: "points" number: 3 type: TYPE_MESSAGE type_name: ".demo.Point"
              label: LABEL_REPEATED }
      field { name: "ranges" number: 4 type: TYPE_INT32 label: LABEL_REPEATED }
      field { name: "image" number: 5 type: TYPE_BYTES label: LABEL_OPTIONAL }
      field { name: "kind" number: 6 type: TYPE_ENUM type_name: ".demo.Kind" label: LABEL_OPTIONAL }
      field { name: "parts" number: 7 type: TYPE_MESSAGE type_name: ".demo.Scene"
              label: LABEL_REPEATED }
      field { name: "stamp" number: 8 type: TYPE_FIXED64 label: LABEL_OPTIONAL }
    }
    enum_type {
      name: "Kind"
      value { name: "ROAD" number: 0 }
      value { name: "YARD" number: 1 }
    }
  })";

inline std::string descriptor_set(const std::string& text) {
  google::protobuf::FileDescriptorSet set;
  if (!google::protobuf::TextFormat::ParseFromString(text, &set)) {
    throw std::logic_error("no descriptor set");
  }
  return set.SerializeAsString();
}

inline mcap::Schema scene_schema(std::uint16_t id = 1) {
  return {
      .id = id, .name = "demo.Scene", .encoding = "protobuf", .data = descriptor_set(kSceneFiles)};
}

inline mcap::Channel scene_channel(std::uint16_t id = 1, const std::string& topic = "scene",
                                   std::uint16_t schema_id = 1) {
  return {.id = id,
          .schema_id = schema_id,
          .topic = topic,
          .message_encoding = "protobuf",
          .metadata = {{"publisher", "painter"}}};
}

/// A scene, from protobuf's text.
inline std::string scene(const std::string& text) {
  const MessageType type(scene_schema());
  const std::unique_ptr<google::protobuf::Message> message = type.parse({});
  if (!google::protobuf::TextFormat::ParseFromString(text, message.get())) {
    throw std::logic_error("no scene");
  }
  return message->SerializeAsString();
}

/// A log of scenes on the topic `scene`, one every 10 ns, from 1000 ns and number 1 on.
inline std::string scenes(const std::vector<std::string>& texts,
                          const mcap::WriterOptions& options = mcap::small_chunks()) {
  mcap::StringSink sink;
  mcap::Writer writer(sink, options);
  writer.add(scene_schema());
  writer.add(scene_channel());
  std::uint32_t number = 0;
  for (const std::string& text : texts) {
    const std::uint64_t time_ns = 1000 + 10 * number++;
    mcap::write_message(
        writer,
        {.channel_id = 1, .sequence = number, .log_time_ns = time_ns, .publish_time_ns = time_ns},
        scene(text));
  }
  writer.close();
  return sink.file();
}

/// Two topics, three chunks, metadata, an attachment: all in order.
inline std::string good_log(const mcap::WriterOptions& options = mcap::small_chunks()) {
  mcap::StringSink sink;
  mcap::Writer writer(sink, options);
  writer.add(scene_schema());
  writer.add(scene_channel());
  writer.add(mcap::kCamera);
  writer.write(mcap::Metadata{.name = "car", .metadata = {{"name", "demo"}}});
  writer.write(mcap::Attachment{
      {.log_time_ns = 5, .create_time_ns = 4, .name = "a.txt", .media_type = "text/plain"},
      mcap::bytes_of("attached")});
  for (std::uint32_t i = 1; i <= 12; ++i) {
    const std::uint64_t time_ns = 100 * i;
    mcap::write_message(writer,
                        {.channel_id = i % 3 == 0 ? mcap::kCamera.id : std::uint16_t{1},
                         .sequence = i % 3 == 0 ? i / 3 : i - i / 3,
                         .log_time_ns = time_ns,
                         .publish_time_ns = time_ns},
                        i % 3 == 0 ? std::string(40, 'c')
                                   : scene(fmt::format("name: 'scene number {}' stamp: {}", i, i)));
  }
  writer.close();
  return sink.file();
}

/// Everything that a reader finds in a file, by its index: messages in the order of their times,
/// all schemas and channels, attachments and metadata.
inline mcap::Lines content_of(std::string_view file) {
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  const mcap::Reader reader(source);
  mcap::Lines lines = mcap::messages_of(reader);
  for (const auto& [id, schema] : reader.definitions().schemas()) {
    lines.push_back(mcap::LineOf{}(schema));
  }
  for (const auto& [id, channel] : reader.definitions().channels()) {
    lines.push_back(mcap::LineOf{}(channel));
  }
  std::vector<std::byte> memory;
  for (const mcap::AttachmentIndex& index : reader.attachments()) {
    lines.push_back(mcap::LineOf{}(reader.read(index, memory)));
  }
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    lines.push_back(mcap::LineOf{}(reader.read(index)));
  }
  return lines;
}

/// Files in, files out.
inline std::vector<std::string> rewritten(const std::vector<std::string>& files,
                                          const Layout& layout = {},
                                          const Selection& selection = {}) {
  std::vector<std::unique_ptr<mcap::MemorySource>> sources;
  std::vector<const mcap::Source*> inputs;
  for (const std::string& file : files) {
    sources.push_back(std::make_unique<mcap::MemorySource>(mcap::bytes_of(file), "test.mcap"));
    inputs.push_back(sources.back().get());
  }
  std::vector<std::unique_ptr<mcap::StringSink>> sinks;
  const auto next = [&](std::uint64_t /*number*/) -> mcap::Sink& {
    sinks.push_back(std::make_unique<mcap::StringSink>());
    return *sinks.back();
  };
  rewrite(inputs, next, layout, selection);
  std::vector<std::string> result;
  for (const auto& sink : sinks) {
    result.push_back(sink->file());
  }
  return result;
}

}  // namespace fastcycle::archive
