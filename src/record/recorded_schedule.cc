#include "record/recorded_schedule.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "log/log.pb.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "record/log_format.h"

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

}  // namespace

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
