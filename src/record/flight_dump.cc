#include "record/flight_dump.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <ctime>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <string_view>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "base/files.h"
#include "log/log.pb.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/record_reader.h"
#include "mcap/writer.h"
#include "record/streams.h"

namespace fastcycle::record {
namespace {

namespace fs = std::filesystem;

constexpr int kInfosAtOnce = 1024;
constexpr std::size_t kLargeBytes = std::size_t{128} << 10U;  // Of a message.

/// Converts `Hard braking!` to a part of a file name: `hard_braking`.
std::string as_name(std::string_view reason) {
  constexpr std::size_t kLongest = 40;
  std::string name;
  for (const char c : reason.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_plain = byte < 0x80 && std::isalnum(byte) != 0;
    if (is_plain) {
      name += static_cast<char>(std::tolower(byte));
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (!name.empty() && name.back() == '_') {
    name.pop_back();
  }
  return name.empty() ? "dump" : name;
}

std::string utc(std::int64_t time_ns) {
  const auto seconds = static_cast<std::time_t>(time_ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d_%H-%M-%S", &parts);
  return text.data();
}

/// `text` of a file that may be damaged, escaped for another one.
std::string printable(std::string_view text) {
  std::string result(text);
  std::ranges::replace_if(result, [](char c) { return c != '\n' && (c < 0x20 || c == 0x7f); }, '?');
  return result;
}

fs::path active_name(fs::path name) {
  return name += ".active";
}

/// An unused name.
fs::path free_name(const fs::path& ring_file, const FlightTrigger& trigger) {
  const std::string begin =
      ring_file.stem().string() + "_" + utc(trigger.time_ns) + "_" + as_name(trigger.reason);
  fs::path name;
  for (unsigned number = 1; name.empty() || fs::exists(name) || fs::exists(active_name(name));
       ++number) {
    name = ring_file;
    name.replace_filename(begin + (number == 1 ? "" : "_" + std::to_string(number)) + ".mcap");
  }
  return name;
}

/// The file of one dump while it is being written.
class DumpFile {
 public:
  DumpFile(const fs::path& name, const FlightWindow& window)
      : name_(name),
        window_(window),
        sink_(active_name(name)),
        writer_(sink_, mcap::WriterOptions{.profile = "fastcycle",
                                           .library = "fastcycle",
                                           .chunk = {.compression = mcap::Compression::kLz4}}) {}

  /// Writes the schemas, channels, metadata and attachments of `explanation`.
  void explain(mcap::Bytes explanation) {
    const mcap::MemorySource source(explanation, name_.string());
    mcap::RecordReader reader(source);
    while (const std::optional<mcap::Record> record = reader.next()) {
      if (const auto* schema = std::get_if<mcap::Schema>(&*record)) {
        writer_.add(*schema);
      } else if (const auto* channel = std::get_if<mcap::Channel>(&*record)) {
        writer_.add(*channel);
      } else if (const auto* metadata = std::get_if<mcap::Metadata>(&*record)) {
        writer_.write(*metadata);
      } else if (const auto* attachment = std::get_if<mcap::Attachment>(&*record)) {
        writer_.write(*attachment);
      }
    }
  }

  void add(const FlightRecord& record) {
    switch (static_cast<FlightKind>(record.kind)) {
      case FlightKind::kMessage:
      case FlightKind::kLatched:
        add_message(record);
        break;
      case FlightKind::kActivations:
        if (record.time_ns >= window_.begin_ns) {
          write(kActivationsChannel, ++activations_, record.time_ns, record.data);
        }
        break;
      case FlightKind::kLoss:
        add_loss(record);
        break;
    }
  }

  void finish(std::uint64_t missing) {
    write_crash();
    write_infos();
    write_losses();
    write_facts(missing);
    writer_.close();
    sink_.sync();
    name_ = base::rename_to_next_free(active_name(name_), name_);
  }
  [[nodiscard]] const fs::path& name() const { return name_; }

  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  void write(std::uint16_t channel, std::uint32_t sequence, std::int64_t time_ns,
             mcap::Bytes data) {
    if (writer_.definitions().find_channel(channel) == nullptr) {
      return;  // The ring is damaged.
    }
    const auto time = static_cast<std::uint64_t>(time_ns);
    if (data.size() >= kLargeBytes) {
      writer_.flush();  // A chunk of its own, without pending schemas and channels.
    }
    writer_.write(
        {.channel_id = channel, .sequence = sequence, .log_time_ns = time, .publish_time_ns = time},
        {&data, 1});
  }

  void add_message(const FlightRecord& record) {
    FlightMessageHead head;
    if (record.data.size() < sizeof(head)) {
      return;
    }
    std::memcpy(&head, record.data.data(), sizeof(head));
    const mcap::Bytes rest = record.data.subspan(sizeof(head));
    const bool is_known = writer_.definitions().find_channel(head.channel) != nullptr;
    if (!is_known || head.info_size > rest.size()) {
      return;
    }
    const bool is_latched = static_cast<FlightKind>(record.kind) == FlightKind::kLatched;
    const bool is_before = head.publish_ns < window_.begin_ns;
    if (is_latched != is_before || head.publish_ns > window_.end_ns ||
        (is_latched && !repeated_.emplace(head.channel, head.sequence).second)) {
      return;
    }
    // Messages published before, and still valid, come first.
    const std::int64_t log_ns = std::max(head.publish_ns, window_.begin_ns);
    const mcap::Bytes data = rest.subspan(head.info_size);
    writer_.write({.channel_id = head.channel,
                   .sequence = head.sequence,
                   .log_time_ns = static_cast<std::uint64_t>(log_ns),
                   .publish_time_ns = static_cast<std::uint64_t>(head.publish_ns)},
                  {&data, 1});
    ++messages_;
    first_ns_ = std::min(first_ns_, log_ns);
    last_ns_ = std::max(last_ns_, log_ns);
    add_info(rest.first(head.info_size));
  }

  void add_info(mcap::Bytes bytes) {
    log::MessageInfo info;
    if (bytes.empty() || !info.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
      return;
    }
    *infos_.add_infos() = std::move(info);
    if (infos_.infos_size() >= kInfosAtOnce) {
      write_infos();
    }
  }

  void write_infos() {
    if (infos_.infos_size() > 0) {
      const std::string text = infos_.SerializeAsString();
      write(kInfosChannel, ++info_lists_, last_ns_, mcap::bytes_of(text));
      infos_.Clear();
    }
  }

  void add_loss(const FlightRecord& record) {
    FlightLoss loss;
    if (record.time_ns < window_.begin_ns || record.data.size() != sizeof(loss)) {
      return;
    }
    std::memcpy(&loss, record.data.data(), sizeof(loss));
    FlightLoss& sum = losses_[loss.channel];
    sum.overflow += loss.overflow;
    sum.pool += loss.pool;
    sum.too_large += loss.too_large;
    sum.process += loss.process;
  }

  /// The unfinished activation, and the crash note of the process.
  void write_crash() {
    if (!window_.crash) {
      return;
    }
    const diagnostics::CrashNote& note = *window_.crash;
    if (note.activation.number != 0) {
      log::Activations activations;
      record::add(activations, note.activation);
      const std::string text = activations.SerializeAsString();
      write(kActivationsChannel, ++activations_, window_.end_ns, mcap::bytes_of(text));
    }
    writer_.write(
        mcap::Metadata{.name = "fastcycle.crash",
                       .metadata = {{"component", printable(note.component.data())},
                                    {"summary", printable(note.summary.data())},
                                    {"report", printable({note.text.data(), note.text_size})}}});
  }

  void write_losses() {
    for (const auto& [id, loss] : losses_) {
      const mcap::Channel* channel = writer_.definitions().find_channel(id);
      if (channel == nullptr) {
        continue;
      }
      writer_.write(mcap::Metadata{.name = "fastcycle.dump_loss",
                                   .metadata = {{"topic", channel->topic},
                                                {"lost.overflow", std::to_string(loss.overflow)},
                                                {"lost.pool", std::to_string(loss.pool)},
                                                {"lost.too_large", std::to_string(loss.too_large)},
                                                {"lost.process", std::to_string(loss.process)}}});
    }
  }

  void write_facts(std::uint64_t missing) {
    const FlightTrigger& trigger = window_.triggers.front();
    std::map<std::string, std::string> facts{{"reason", trigger.reason},
                                             {"component", trigger.component},
                                             {"detail", trigger.detail},
                                             {"trigger_ns", std::to_string(trigger.time_ns)},
                                             {"begin_ns", std::to_string(window_.begin_ns)},
                                             {"end_ns", std::to_string(window_.end_ns)},
                                             {"messages", std::to_string(messages_)},
                                             {"missing", std::to_string(missing)},
                                             {"triggers", std::to_string(window_.trigger_count)}};
    if (messages_ > 0) {
      facts["first_ns"] = std::to_string(first_ns_);
      facts["last_ns"] = std::to_string(last_ns_);
    }
    for (std::size_t i = 1; i < window_.triggers.size(); ++i) {
      const FlightTrigger& other = window_.triggers[i];
      facts["trigger." + std::to_string(i)] =
          fmt::format("{} {} {}", other.time_ns, other.reason, other.component);
    }
    writer_.write(mcap::Metadata{.name = "fastcycle.dump", .metadata = std::move(facts)});
  }

  fs::path name_;
  const FlightWindow& window_;
  mcap::FileSink sink_;
  mcap::Writer writer_;
  log::MessageInfos infos_;
  std::set<std::pair<std::uint16_t, std::uint32_t>> repeated_;  ///< Latched ones already written.
  std::map<std::uint16_t, FlightLoss> losses_;                  ///< By channel.
  std::uint32_t activations_ = 0;
  std::uint32_t info_lists_ = 0;
  std::uint64_t messages_ = 0;
  std::int64_t first_ns_ = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_ns_ = 0;
};

/// The time span of a ring's records; none if it has none, or was closed.
std::optional<FlightWindow> window_of_crash(const fs::path& ring_file) {
  FlightRingReader ring(ring_file);
  std::optional<FlightWindow> window;
  while (!ring.is_closed()) {
    const std::optional<FlightRecord> record = ring.next();
    if (!record) {
      break;
    }
    if (!window) {
      window.emplace();
      window->begin_ns = window->end_ns = record->time_ns;
    }
    window->begin_ns = std::min(window->begin_ns, record->time_ns);
    window->end_ns = std::max(window->end_ns, record->time_ns);
  }
  if (window) {
    window->crash = ring.crash_note();
    window->triggers.push_back(
        {.time_ns = window->end_ns,
         .reason = "crash",
         .component = window->crash ? printable(window->crash->component.data()) : "",
         .detail = window->crash ? printable(window->crash->summary.data())
                                 : fmt::format("process {} did not end in order", ring.pid())});
  }
  return window;
}

void set_aside(const fs::path& ring_file, FlightDump& dump) {
  fs::path left = ring_file;
  left += ".left";
  std::error_code error;
  fs::rename(ring_file, left, error);
  dump.problem += error ? "; it cannot be set aside either: " + error.message()
                        : "; what it has stays in " + left.string();
}

}  // namespace

FlightDump write_dump(FlightRingReader& ring, const FlightWindow& window,
                      const fs::path& ring_file) {
  FlightDump dump{.trigger = window.triggers.front(), .trigger_count = window.trigger_count};
  try {
    dump.file = free_name(ring_file, dump.trigger);
    DumpFile file(dump.file, window);
    file.explain(ring.explanation());
    while (const std::optional<FlightRecord> record = ring.next()) {
      file.add(*record);
      dump.messages = file.messages();
    }
    dump.missing = ring.missing();
    file.finish(dump.missing);
    dump.file = file.name();
  } catch (const std::exception& error) {  // Includes file system errors.
    dump.problem = error.what();
  }
  return dump;
}

std::optional<FlightDump> dump_crashed(const fs::path& ring_file) {
  if (fs::symlink_status(ring_file).type() == fs::file_type::not_found) {
    return std::nullopt;
  }
  FlightDump dump{.trigger = {.reason = "crash"}};
  try {
    const std::optional<FlightWindow> window = window_of_crash(ring_file);
    if (!window) {
      return std::nullopt;
    }
    FlightRingReader ring(ring_file);
    dump = write_dump(ring, *window, ring_file);
  } catch (const mcap::Damage& damage) {
    if (!begins_as_ring(ring_file)) {
      throw;
    }
    dump.problem = damage.what();
  }
  if (!dump.problem.empty()) {
    set_aside(ring_file, dump);
  }
  return dump;
}

}  // namespace fastcycle::record
