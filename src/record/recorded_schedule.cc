#include "record/recorded_schedule.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <sys/stat.h>

#include "log/log.pb.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "record/log_format.h"
#include "record/recording_reader.h"

namespace fastcycle::record {
namespace {

RecordedActivation to_recorded(const log::Activation& activation) {
  RecordedActivation recorded;
  recorded.number = activation.number();
  recorded.cause = static_cast<detail::Cause>(activation.cause());
  recorded.outcome = static_cast<detail::Outcome>(activation.outcome());
  if (activation.has_subscription()) {
    recorded.subscription = activation.subscription();
  }
  recorded.publisher = activation.publisher();
  recorded.key = activation.key();
  recorded.skipped = activation.skipped();
  recorded.time_ns = activation.time_ns();
  recorded.late_ns = activation.late_ns();
  recorded.publish_count = activation.publish_count();
  recorded.reads_lost = activation.reads_lost();
  for (const log::Read& read : activation.reads()) {
    recorded.reads.push_back({.read = {.activation = recorded.number,
                                       .kind = static_cast<detail::ReadKind>(read.kind()),
                                       .place = read.place(),
                                       .publisher = read.publisher(),
                                       .value = read.value()},
                              .text = read.text()});
  }
  return recorded;
}

/// The files of one run agree about it, and only the last one has the run's end.
///
/// @param last  The file with the run's end; empty before.
void take_facts(const mcap::Source& source, const mcap::Reader& reader, RecordedSchedule& schedule,
                std::string& last) {
  const auto refuse = [&](const std::string& found) {
    throw mcap::Damage({.place = {.file = source.name()},
                        .record = "the log",
                        .expected = "files of one run",
                        .found = found});
  };
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    if (index.name == kRunMetadata) {
      auto facts = reader.read(index).metadata;
      if (schedule.facts.empty()) {
        schedule.facts = facts;
      }
      for (const char* const fact : {"application", "start_ns"}) {
        if (facts.contains(fact) && facts[fact] != schedule.facts[fact]) {
          refuse(fmt::format("{} {}, and {} in the files before", fact, facts[fact],
                             schedule.facts[fact]));
        }
      }
    } else if (index.name == kEndMetadata) {
      if (!last.empty()) {
        refuse(fmt::format("the end of a second run: {} has one too", last));
      }
      last = source.name();
    }
  }
  for (const mcap::AttachmentIndex& index : reader.attachments()) {
    if (index.name == "application.json" && schedule.application.empty()) {
      std::vector<std::byte> memory;
      const mcap::Attachment attachment = reader.read(index, memory);
      schedule.application.assign(reinterpret_cast<const char*>(attachment.data.data()),
                                  attachment.data.size());
    }
  }
}

void take_names(RecordedSchedule& schedule) {
  for (;;) {
    const auto name = schedule.facts.find(fmt::format("component.{}", schedule.components.size()));
    if (name == schedule.facts.end()) {
      return;
    }
    schedule.components.push_back({.name = name->second});
  }
}

void take_activations(const mcap::Source& source, const mcap::Reader& reader,
                      RecordedSchedule& schedule) {
  mcap::MessageReader messages = reader.messages({.topics = {kActivationsTopic}});
  while (const auto message = messages.next()) {
    log::Activations activations;
    if (!activations.ParseFromArray(message->data.data(), static_cast<int>(message->data.size()))) {
      throw mcap::Damage({.place = {.file = source.name()},
                          .record = std::string("a message of ") + kActivationsTopic,
                          .expected = "fastcycle.log.Activations",
                          .found = fmt::format("{} bytes that are none", message->data.size())});
    }
    schedule.lost += activations.lost();
    for (const log::Activation& activation : activations.activations()) {
      if (activation.component() >= schedule.components.size()) {
        continue;
      }
      RecordedSchedule::Component& component = schedule.components[activation.component()];
      if (activations.incarnation() > 1) {
        component.is_restarted = true;
      } else {
        component.activations.push_back(to_recorded(activation));
      }
    }
  }
}

/// What tells of which run a file is, and what it has of it.
struct FileOfRun {
  std::string name;
  std::vector<std::string> run;  ///< Facts that all files of one run share; empty: unknown.
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  std::set<std::pair<std::string, std::string>> streams;  ///< Topic and publisher.

  [[nodiscard]] bool overlaps(const FileOfRun& other) const {
    return begin_ns <= other.end_ns && other.begin_ns <= end_ns;
  }
};

FileOfRun look_at(const std::filesystem::path& path) {
  const mcap::FileSource source(path);
  const mcap::Reader reader(source);
  const mcap::Statistics& statistics = *reader.statistics();
  FileOfRun file{.name = path.string(),
                 .run = {},
                 .begin_ns = statistics.message_start_time_ns,
                 .end_ns = statistics.message_end_time_ns,
                 .streams = {}};
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    if (index.name != kRunMetadata) {
      continue;
    }
    const auto facts = reader.read(index).metadata;
    // A recorded replay has the times of the run that it replays.
    for (const char* const fact : {"application", "host", "start_ns", "clock", "replay.0"}) {
      const auto found = facts.find(fact);
      file.run.push_back(found == facts.end() ? std::string() : found->second);
    }
    break;
  }
  for (const auto& [id, channel] : reader.definitions().channels()) {
    const auto publisher = channel.metadata.find("publisher");
    const auto count = statistics.channel_message_counts.find(id);
    if (publisher != channel.metadata.end() && count != statistics.channel_message_counts.end() &&
        count->second > 0) {
      file.streams.emplace(channel.topic, publisher->second);
    }
  }
  return file;
}

}  // namespace

std::string find_named_twice(const std::vector<std::filesystem::path>& files) {
  std::map<std::pair<dev_t, ino_t>, std::filesystem::path> seen;
  for (const std::filesystem::path& path : files) {
    struct stat status{};
    if (::stat(path.c_str(), &status) != 0) {
      continue;  // Opening it says why.
    }
    const auto [first, is_new] = seen.try_emplace({status.st_dev, status.st_ino}, path);
    if (!is_new) {
      return first->second == path
                 ? path.string() + " is named twice"
                 : first->second.string() + " and " + path.string() + " are the same file";
    }
  }
  return {};
}

std::string find_overlapping_runs(const std::vector<std::filesystem::path>& files,
                                  const std::vector<RecordedStream>& streams) {
  std::vector<FileOfRun> before;
  for (std::size_t i = 0; files.size() > 1 && i < files.size(); ++i) {
    FileOfRun file = look_at(files[i]);
    for (const FileOfRun& other : before) {
      if (file.run.empty() || other.run.empty() || file.run == other.run || !file.overlaps(other)) {
        continue;
      }
      for (const RecordedStream& stream : streams) {
        const std::pair key(stream.topic, stream.publisher);
        if (file.streams.contains(key) && other.streams.contains(key)) {
          return fmt::format(
              "{} and {} are of different runs at the same time, and \"{}\" published \"{}\" in "
              "both",
              other.name, file.name, stream.publisher, stream.topic);
        }
      }
    }
    before.push_back(std::move(file));
  }
  return {};
}

const RecordedSchedule::Component* RecordedSchedule::find(const std::string& name) const {
  const auto found = std::ranges::find(components, name, &Component::name);
  return found == components.end() ? nullptr : &*found;
}

RecordedSchedule RecordedSchedule::read(const std::vector<std::filesystem::path>& files) {
  RecordedSchedule schedule;
  std::string last;
  for (const std::filesystem::path& path : files) {
    const mcap::FileSource source(path);
    const mcap::Reader reader(source);
    if (const auto& problem = reader.problem()) {
      schedule.notes.push_back(mcap::to_string(*problem) + "; what is before that is read");
    }
    take_facts(source, reader, schedule, last);
    if (schedule.components.empty()) {
      take_names(schedule);
    }
    take_activations(source, reader, schedule);
  }
  for (Component& component : schedule.components) {
    std::ranges::sort(component.activations, {}, &RecordedActivation::number);
  }
  return schedule;
}

}  // namespace fastcycle::record
