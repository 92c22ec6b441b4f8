#pragma once

// For tests: decodes a trace by its wire format alone.

#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::trace {

/// The fields of a message, by number, in order.
struct TestMessage {
  std::multimap<unsigned, std::uint64_t> numbers;
  std::multimap<unsigned, std::string> texts;  ///< Also messages.

  [[nodiscard]] std::uint64_t number(unsigned field) const {
    const auto found = numbers.find(field);
    return found == numbers.end() ? 0 : found->second;
  }
  [[nodiscard]] std::string text(unsigned field) const {
    const auto found = texts.find(field);
    return found == texts.end() ? "" : found->second;
  }
  [[nodiscard]] bool has(unsigned field) const {
    return numbers.contains(field) || texts.contains(field);
  }
};

inline TestMessage read_message(std::string_view bytes) {
  std::size_t at = 0;
  const auto varint = [&] {
    std::uint64_t value = 0;
    for (unsigned shift = 0;; shift += 7) {
      const auto byte = static_cast<unsigned char>(bytes.at(at++));
      value |= std::uint64_t{byte & 0x7fU} << shift;
      if (byte < 0x80) {
        return value;
      }
    }
  };
  TestMessage message;
  while (at < bytes.size()) {
    const std::uint64_t tag = varint();
    const auto field = static_cast<unsigned>(tag >> 3U);
    switch (tag & 7U) {
      case 0:
        message.numbers.emplace(field, varint());
        break;
      case 1: {
        std::uint64_t value = 0;
        for (unsigned i = 0; i < 8; ++i) {
          value |= std::uint64_t{static_cast<unsigned char>(bytes.at(at++))} << (8 * i);
        }
        message.numbers.emplace(field, value);
        break;
      }
      case 2: {
        const std::uint64_t size = varint();
        if (size > bytes.size() - at) {
          throw std::runtime_error("a field is longer than its message");
        }
        message.texts.emplace(field, bytes.substr(at, size));
        at += size;
        break;
      }
      default:
        throw std::runtime_error("no such wire type");
    }
  }
  return message;
}

/// An event with its names.
struct TestEvent {
  std::uint64_t type = 0;
  std::int64_t time_ns = 0;
  std::uint64_t track = 0;
  std::string name;
  std::string category;
  std::uint64_t flow_from = 0;
  std::uint64_t flow_to = 0;
  std::uint64_t value = 0;
  std::string what;
  std::map<std::string, std::int64_t> annotations;
};

struct TestSlice {
  std::uint64_t track = 0;
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::string name;
  std::string category;
  std::map<std::string, std::int64_t> annotations;
};

/// The contents of a trace.
struct TestTrace {
  std::map<std::uint64_t, TestMessage> tracks;
  std::vector<TestEvent> events;
  std::vector<TestSlice> slices;  ///< In the order of their ends.
  std::map<std::uint64_t, std::int64_t> clocks;
  bool says_that_packets_were_dropped = false;
  std::size_t packets = 0;

  [[nodiscard]] std::string track_name(std::uint64_t track) const {
    const TestMessage& descriptor = tracks.at(track);
    if (descriptor.has(4)) {
      return read_message(descriptor.text(4)).text(5);
    }
    return descriptor.has(3) ? read_message(descriptor.text(3)).text(6) : descriptor.text(2);
  }
};

/// Reads a trace, and throws if an unknown name is used, or a slice ends that did not begin.
inline TestTrace read_trace(std::string_view bytes) {
  TestTrace trace;
  std::map<std::uint64_t, std::string> categories;
  std::map<std::uint64_t, std::string> names;
  std::map<std::uint64_t, std::string> annotation_names;
  std::map<std::uint64_t, std::vector<TestSlice>> open;
  const TestMessage whole = read_message(bytes);
  for (auto [packet_bytes, end] = whole.texts.equal_range(1); packet_bytes != end; ++packet_bytes) {
    const TestMessage packet = read_message(packet_bytes->second);
    ++trace.packets;
    trace.says_that_packets_were_dropped |= packet.has(42);
    if ((packet.number(13) & 1U) != 0) {
      categories.clear();
      names.clear();
      annotation_names.clear();
    }
    if (packet.has(12)) {
      const TestMessage interned = read_message(packet.text(12));
      const auto learn = [&](unsigned field, auto& known) {
        for (auto [it, last] = interned.texts.equal_range(field); it != last; ++it) {
          const TestMessage name = read_message(it->second);
          known[name.number(1)] = name.text(2);
        }
      };
      learn(1, categories);
      learn(2, names);
      learn(3, annotation_names);
    }
    if (packet.has(6)) {
      const TestMessage snapshot = read_message(packet.text(6));
      for (auto [it, last] = snapshot.texts.equal_range(1); it != last; ++it) {
        const TestMessage clock = read_message(it->second);
        trace.clocks[clock.number(1)] = static_cast<std::int64_t>(clock.number(2));
      }
    }
    if (packet.has(60)) {
      const TestMessage track = read_message(packet.text(60));
      trace.tracks[track.number(1)] = track;
    }
    if (!packet.has(11)) {
      continue;
    }
    const TestMessage event = read_message(packet.text(11));
    TestEvent read{.type = event.number(9),
                   .time_ns = static_cast<std::int64_t>(packet.number(8)),
                   .track = event.number(11),
                   .name = event.has(10) ? names.at(event.number(10)) : "",
                   .category = event.has(3) ? categories.at(event.number(3)) : "",
                   .flow_from = event.number(47),
                   .flow_to = event.number(48),
                   .value = event.number(30),
                   .what = {},
                   .annotations = {}};
    for (auto [it, last] = event.texts.equal_range(4); it != last; ++it) {
      const TestMessage annotation = read_message(it->second);
      if (annotation.has(6)) {
        read.what = annotation.text(6);
      } else {
        read.annotations[annotation_names.at(annotation.number(1))] =
            static_cast<std::int64_t>(annotation.number(4));
      }
    }
    if (!trace.tracks.contains(read.track)) {
      throw std::runtime_error("an event on no track");
    }
    if (read.type == 1) {
      open[read.track].push_back({.track = read.track,
                                  .begin_ns = read.time_ns,
                                  .end_ns = 0,
                                  .name = read.name,
                                  .category = read.category,
                                  .annotations = read.annotations});
    } else if (read.type == 2) {
      if (open[read.track].empty()) {
        throw std::runtime_error("a slice ends that did not begin");
      }
      trace.slices.push_back(open[read.track].back());
      trace.slices.back().end_ns = read.time_ns;
      open[read.track].pop_back();
    }
    trace.events.push_back(std::move(read));
  }
  for (const auto& [track, slices] : open) {
    if (!slices.empty()) {
      throw std::runtime_error("a slice does not end");
    }
  }
  return trace;
}

inline std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The output of `protoc --decode_raw` for `file`; throws if it fails.
inline std::string decode_raw(const std::filesystem::path& file) {
  const std::string command = "protoc --decode_raw < '" + file.string() + "' 2>&1";
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), &::pclose);
  std::string text;
  std::array<char, 4096> part{};
  while (const std::size_t size = std::fread(part.data(), 1, part.size(), pipe.get())) {
    text.append(part.data(), size);
  }
  if (text.empty() || text.find("Failed to parse") != std::string::npos) {
    throw std::runtime_error("protoc cannot read it: " + text);
  }
  return text;
}

}  // namespace fastcycle::trace
