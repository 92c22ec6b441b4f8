// record: what recording costs the application. disk: how fast a recording goes to the disk.

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench/beside.h"
#include "bench/modes.h"
#include "mcap/record_reader.h"
#include "measure/clock.h"
#include "measure/payload.h"
#include "measure/statistics.h"

namespace fastcycle::tool::bench {
namespace {

constexpr double kMega = 1e6;
constexpr const char* kCopied = "floor-copy";
constexpr const char* kRecorded = "recorded";
constexpr const char* kMessages = "messages-only";  // Recorded without activations.
constexpr const char* kBackground = "background";

std::runtime_error trouble_with(const std::filesystem::path& file) {
  return std::runtime_error("bench: " + file.string() + ": " + std::strerror(errno));
}

/// A folder for one recording, removed with it.
class RecordingFolder {
 public:
  explicit RecordingFolder(const std::filesystem::path& place, std::int64_t bytes) {
    // A quarter more, for what comes beside the payloads.
    const std::int64_t needed = bytes + bytes / 4 + (64 << 20);
    std::error_code error;
    const std::filesystem::space_info space = std::filesystem::space(place, error);
    if (error) {
      throw std::runtime_error("bench: --dir " + place.string() + ": " + error.message());
    }
    if (space.available < static_cast<std::uintmax_t>(needed)) {
      throw std::runtime_error(fmt::format(
          "bench: {} has {} MB left, and this needs {}; use a smaller --count or another --dir",
          place.string(), space.available / 1'000'000, needed / 1'000'000));
    }
    path_ = (place / "fastcycle-bench-XXXXXX").string();
    if (mkdtemp(path_.data()) == nullptr) {
      throw trouble_with(path_);
    }
  }
  RecordingFolder(const RecordingFolder&) = delete;
  RecordingFolder& operator=(const RecordingFolder&) = delete;
  ~RecordingFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  [[nodiscard]] std::filesystem::path file() const {
    return std::filesystem::path(path_) / "bench.mcap";
  }

 private:
  std::string path_;
};

/// False if not all of `block` could be appended.
bool append(int file, const std::vector<char>& block) {
  for (std::size_t done = 0; done < block.size();) {
    const ssize_t written = ::write(file, block.data() + done, block.size() - done);
    if (written < 0 && errno != EINTR) {
      return false;
    }
    done += static_cast<std::size_t>(std::max<ssize_t>(written, 0));
  }
  return true;
}

/// Memory of the process, in bytes: `VmRSS` or `VmHWM`; 0 if it is unknown.
std::int64_t memory(std::string_view name) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    std::int64_t kib = 0;
    if (word == std::string(name) + ":" && status >> kib) {
      return kib * 1024;
    }
  }
  return 0;
}

/// The CPU time used by the process so far.
std::int64_t process_cpu_ns() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return time.tv_sec * 1'000'000'000 + time.tv_nsec;
}

/// The most that the process holds at once while this lives, beyond what it held when it began.
class PeakMemory {
 public:
  PeakMemory() : begin_(memory("VmRSS")) {
    std::ofstream("/proc/self/clear_refs") << 5;  // Forgets earlier peaks.
  }
  [[nodiscard]] std::int64_t bytes() const { return memory("VmHWM") - begin_; }

 private:
  std::int64_t begin_;
};

/// Appends a block to a new file each interval, on its own thread: the cost of the system alone for
/// as many bytes as are published.
class Copying {
 public:
  Copying(const std::filesystem::path& path, std::int64_t size, std::int64_t interval_us)
      : block_(static_cast<std::size_t>(size)),
        file_(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)) {
    if (file_ < 0) {
      throw trouble_with(path);
    }
    measure::fill(block_.data(), block_.size(), 'x');
    thread_ = std::jthread([this, interval_us](const std::stop_token& stop) {
      for (std::int64_t due_ns = measure::now_ns(); !stop.stop_requested() && !has_failed_;
           due_ns += interval_us * 1000) {
        measure::sleep_until(due_ns);
        has_failed_ = !append(file_, block_);
      }
    });
  }
  Copying(const Copying&) = delete;
  Copying& operator=(const Copying&) = delete;
  ~Copying() {
    thread_.request_stop();
    thread_.join();
    ::close(file_);
  }

  [[nodiscard]] bool has_failed() const { return has_failed_; }

 private:
  std::vector<char> block_;
  int file_;
  std::atomic<bool> has_failed_{false};
  std::jthread thread_;
};

void record_into(Json& application, const std::filesystem::path& file) {
  application["record"] = {{"file", file.string()}, {"compression", "none"}};
}

/// Messages of the topic in the file, by reading all of it: CRCs are checked.
std::uint64_t count_in(const std::filesystem::path& file, std::string_view topic) {
  const mcap::FileSource source(file);
  mcap::RecordReader reader(source);
  std::uint64_t count = 0;
  while (const auto record = reader.next()) {
    const auto* const message = std::get_if<mcap::Message>(&*record);
    if (message != nullptr &&
        reader.definitions().find_channel(message->channel_id)->topic == topic) {
      ++count;
    }
  }
  if (reader.stop()->reason != mcap::Stop::Reason::kEnd) {
    throw std::runtime_error("bench: " + to_string(reader.stop()->problem));
  }
  return count;
}

/// Adds the fate of the payloads, and checks the file against the recorder's report.
void add_recording(Finding& finding, const host::RecordingReport& recording,
                   const std::filesystem::path& file) {
  const auto payload =
      std::ranges::find(recording.topics, "payload", &record::RecordedTopic::topic);
  const std::uint64_t in_file = count_in(file, "payload");
  finding.row.more += fmt::format(
      ",\"published\":{},\"recorded\":{},\"record_lost\":{},\"lost_overflow\":{},\"lost_pool\":{},"
      "\"lost_memory\":{},\"lost_disk\":{},\"in_file\":{},\"file_bytes\":{}",
      payload->published, payload->recorded, payload->lost(), payload->overflow, payload->pool,
      payload->memory, payload->disk, in_file, std::filesystem::file_size(file));
  if (in_file != payload->recorded || payload->published != payload->recorded + payload->lost()) {
    finding.trouble = fmt::format("published {}, recorded {}, lost {}, but in the file {}",
                                  payload->published, payload->recorded, payload->lost(), in_file);
  }
}

// ---------------------------------------------------------------------------------------------
// record

Finding measure_record(Session& session, const std::string& what, const std::string& wait,
                       std::int64_t size) {
  const Options& options = session.options();
  const bool is_recorded = what == kRecorded || what == kMessages || what == kBackground;
  Json json = application_beside(options, size, wait, session.folder());
  std::optional<RecordingFolder> folder;
  if (what != kWithout) {
    folder.emplace(options.record_folder, size * (options.count + options.warmup));
  }
  if (is_recorded) {
    record_into(json, folder->file());
    json["record"]["background"] = what == kBackground;
    json["record"]["activations"] = what != kMessages;
  }
  const PeakMemory peak;
  std::optional<Copying> copying;
  RunHooks hooks;
  if (what == kCopied) {
    hooks.after_start = [&] { copying.emplace(folder->file(), size, options.interval_us); };
  }
  const std::int64_t cpu_begin_ns = process_cpu_ns();
  const Finished finished = session.run_application(json, hooks);
  const std::int64_t cpu_ns = process_cpu_ns() - cpu_begin_ns;
  if (copying && copying->has_failed()) {
    throw std::runtime_error("bench: " + folder->file().string() + " could not be written");
  }
  copying.reset();
  Finding finding = finding_beside(session, what, wait, size, finished);
  finding.row.more += fmt::format(
      ",\"peak_bytes\":{},\"process_cpu_us_per_msg\":{:.3f}", peak.bytes(),
      static_cast<double>(cpu_ns) / 1e3 / static_cast<double>(options.count + options.warmup));
  if (is_recorded) {
    add_recording(finding, finished.report.recording.value(), folder->file());
  }
  return finding;
}

// ---------------------------------------------------------------------------------------------
// disk

std::int64_t total_bytes(const Options& options, std::int64_t size) {
  return size * options.count;
}

Finding disk_finding(const Session& session, const std::string& peer, std::int64_t size,
                     std::int64_t bytes, std::int64_t begin_ns, std::int64_t end_ns) {
  Finding finding{.row = session.row(peer, size)};
  finding.row.n = session.options().count;
  finding.row.interval_us = 0;
  finding.row.more = fmt::format(
      "\"bytes\":{},\"seconds\":{:.3f},\"mb_per_s\":{:.1f}", bytes,
      static_cast<double>(end_ns - begin_ns) / 1e9,
      static_cast<double>(bytes) * 1e9 / static_cast<double>(end_ns - begin_ns) / kMega);
  return finding;
}

/// Blocks as large as our messages, by one thread, and one sync at the end.
Finding measure_writes(const Session& session, std::int64_t size) {
  const Options& options = session.options();
  const std::int64_t bytes = total_bytes(options, size);
  const RecordingFolder folder(options.record_folder, bytes);
  std::vector<char> block(static_cast<std::size_t>(size));
  measure::fill(block.data(), block.size(), 'x');
  const std::int64_t begin_ns = measure::now_ns();
  const int file = ::open(folder.file().c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) {
    throw trouble_with(folder.file());
  }
  bool is_written = true;
  for (std::int64_t i = 0; i < options.count && is_written && !session.is_stopped(); ++i) {
    is_written = append(file, block);
  }
  is_written = is_written && ::fdatasync(file) == 0;
  const std::int64_t end_ns = measure::now_ns();
  ::close(file);
  if (!is_written) {
    throw trouble_with(folder.file());
  }
  return disk_finding(session, "floor-write", size, bytes, begin_ns, end_ns);
}

/// A file in memory, of blocks that are not zero: some disks need not store zeros.
void write_source(const std::filesystem::path& file, std::int64_t size, std::int64_t count) {
  std::string block(static_cast<std::size_t>(size), 'x');
  std::ofstream stream(file, std::ios::binary);
  for (std::int64_t i = 0; i < count; ++i) {
    stream.write(block.data(), static_cast<std::streamsize>(block.size()));
  }
  stream.close();
  if (!stream) {
    throw trouble_with(file);
  }
}

/// The same by the tool that everybody has.
Finding measure_dd(const Session& session, std::int64_t size) {
  const Options& options = session.options();
  const std::int64_t bytes = total_bytes(options, size);
  const RecordingFolder folder(options.record_folder, bytes);
  const RecordingFolder source(options.source_folder, bytes);
  write_source(source.file(), size, options.count);
  std::array<std::string, 7> words{"dd",
                                   "if=" + source.file().string(),
                                   "of=" + folder.file().string(),
                                   fmt::format("bs={}", size),
                                   fmt::format("count={}", options.count),
                                   "conv=fdatasync",
                                   "status=none"};
  std::array<char*, words.size() + 1> pointers{};
  std::ranges::transform(words, pointers.begin(), [](std::string& word) { return word.data(); });
  const std::int64_t begin_ns = measure::now_ns();
  pid_t process = 0;
  int status = 0;
  if (posix_spawnp(&process, "dd", nullptr, nullptr, pointers.data(), environ) != 0 ||
      waitpid(process, &status, 0) != process || status != 0) {
    throw std::runtime_error("bench: dd could not be run, or could not write " +
                             folder.file().string());
  }
  return disk_finding(session, "dd", size, bytes, begin_ns, measure::now_ns());
}

Json disk_application(const Options& options, std::int64_t size) {
  return application(Json::array({executor(options, "publisher", "park", 0)}),
                     Json::array({source(options, size)}));
}

/// In simulated time, where the run waits for the disk and nothing is lost.
Finding measure_recording(Session& session, std::int64_t size) {
  const Options& options = session.options();
  const RecordingFolder folder(options.record_folder, total_bytes(options, size));
  Json json = disk_application(options, size);
  record_into(json, folder.file());
  const PeakMemory peak;
  const Finished finished =
      session.run_application(json, {.clock = {.is_simulated = true, .rate = 1.0, .workers = 1}});
  const auto bytes = static_cast<std::int64_t>(std::filesystem::file_size(folder.file()));
  Finding finding = disk_finding(session, "recorded", size, bytes, finished.stages.built_ns,
                                 finished.stages.stopped_ns);
  finding.row.more += fmt::format(",\"peak_bytes\":{}", peak.bytes());
  add_recording(finding, finished.report.recording.value(), folder.file());
  return finding;
}

}  // namespace

Mode record_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = application_beside(options, options.sizes.front(), options.waits.front(), {});
  record_into(mode.application, options.record_folder / "bench.mcap");
  mode.title = fmt::format(
      "with and without a recording into {}, µs; {} messages after {} of warm-up, one each {} µs",
      options.record_folder.string(), options.count, options.warmup, options.interval_us);
  mode.columns = {{"size", "size"},
                  {"peer", "peer"},
                  {"publish p50", "publish_p50_us", 2},
                  {"publish p99", "publish_p99_us", 2},
                  {"transfer p50", "p50_us"},
                  {"transfer p99", "p99_us"},
                  {"lost", "lost", 0},
                  {"process cpu/msg", "process_cpu_us_per_msg", 2},
                  {"recorded", "recorded", 0},
                  {"record lost", "record_lost", 0},
                  {"peak bytes", "peak_bytes", 0},
                  {"publish p99/without", "publish_p99_us_ratio", 2},
                  {"transfer p99/without", "p99_us_ratio", 2}};
  mode.after_round = add_ratios;
  for (const std::int64_t size : options.sizes) {
    for (const std::string& wait : options.waits) {
      Point point;
      for (const char* const what : {kWithout, kCopied, kMessages, kRecorded, kBackground}) {
        point.steps.push_back(
            {.peer = fmt::format("{}-{}", what, wait), .measure = [session, what, wait, size] {
               return measure_record(*session, what, wait, size);
             }});
      }
      mode.points.push_back(std::move(point));
    }
  }
  return mode;
}

Mode disk_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = disk_application(options, options.sizes.front());
  record_into(mode.application, options.record_folder / "bench.mcap");
  mode.title = fmt::format("{} messages into {}, until the disk has them", options.count,
                           options.record_folder.string());
  mode.ratio_of = "mb_per_s";
  mode.columns = {{"size", "size"},
                  {"peer", "peer"},
                  {"MB/s", "mb_per_s"},
                  {"seconds", "seconds", 2},
                  {"record lost", "record_lost", 0},
                  {"peak bytes", "peak_bytes", 0},
                  {"MB/s / floor", kRatioKey, 2}};
  for (const std::int64_t size : options.sizes) {
    Point point;
    point.steps.push_back({.peer = "floor-write",
                           .measure = [session, size] { return measure_writes(*session, size); }});
    point.steps.push_back({.peer = "dd",
                           .measure = [session, size] { return measure_dd(*session, size); },
                           .floor = "floor-write"});
    point.steps.push_back({.peer = "recorded",
                           .measure = [session, size] { return measure_recording(*session, size); },
                           .floor = "floor-write"});
    mode.points.push_back(std::move(point));
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
