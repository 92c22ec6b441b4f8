// fastcycle_recorder_kills: kills `fastcycle run --record` again and again while it records some
// 200 MB/s, and looks at what each file has.
//
//   fastcycle_recorder_kills PROGRAM FOLDER SECONDS [NODE SCRIPT]
//
// PROGRAM is fastcycle, FOLDER a place on a disk. With NODE and SCRIPT (tests/npm/read_log.mjs) the
// reader of npm counts the messages of each file as well. Ends with 1 after the first file that
// does not have what it must, and leaves that file where it is.

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmark/payload.pb.h"
#include "mcap/reader.h"
#include "mcap/record_reader.h"
#include "measure/clock.h"
#include "process/process.h"
#include "recorder/page.h"

namespace fastcycle::recorder_test {
namespace {

using measure::now_ns;
using nlohmann::json;
using test::Process;

/// What a crash may take, in nanoseconds before it, apart from the time for which the machine held
/// the recorder back. On a machine that others share, one of twenty runs may miss more, up to
/// `kMostMissed`.
constexpr std::int64_t kMayMiss = 100'000'000;
constexpr std::int64_t kMostMissed = 2'000'000'000;
constexpr std::int64_t kMillisecond = 1'000'000;
/// Runs whose files the reader of npm looks at together: it takes long to start.
constexpr std::size_t kBatch = 8;

struct Stream {
  const char* topic;
  std::int64_t size_bytes;
  std::int64_t period_us;
};

// Together 200 MB/s: borrowed messages, copied ones, and many small ones.
constexpr std::array<Stream, 5> kStreams{{{"camera", 1'048'576, 9'000},
                                          {"lidar", 400'000, 7'000},
                                          {"tracks", 24'000, 1'000},
                                          {"radar", 2'000, 500},
                                          {"imu", 200, 1'000}}};

/// A file is not what it must be.
class Failure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

std::filesystem::path page_of(const std::filesystem::path& folder, const std::string& topic) {
  return folder / (topic + ".page");
}

/// Half of the runs compress the small messages, and half are synced so often that it always
/// happens beside the writing.
void write_application(const std::filesystem::path& folder, std::mt19937_64& random) {
  json application = {{"name", "killed"},
                      {"executors", {{{"name", "publisher"}, {"threads", 1}}}},
                      {"components", json::array()},
                      {"record",
                       {{"file", (folder / "drive.mcap").string()},
                        {"compression", random() % 2 == 0 ? "none" : "lz4"},
                        {"compression_by_topic", {{"camera", "none"}, {"lidar", "none"}}},
                        {"sync_ms", random() % 2 == 0 ? 1000 : 50},
                        {"memory_mb", 2048}}}};  // A slow disk is no part of this test.
  for (const Stream& stream : kStreams) {
    application["components"].push_back({{"name", stream.topic},
                                         {"library", "recorder_parts"},
                                         {"executor", "publisher"},
                                         {"params",
                                          {{"size_bytes", stream.size_bytes},
                                           {"period_us", stream.period_us},
                                           {"page", page_of(folder, stream.topic).string()}}}});
  }
  std::ofstream(folder / "app.json") << application.dump(2);
}

/// What a file has of one topic.
struct Found {
  std::uint64_t last = 0;  ///< Sequence; all from 1 on are there, in order.
  std::uint64_t in_whole_chunks = 0;
  std::uint64_t bytes = 0;
};

/// How long the machine held the recorder back until a moment: its threads waited for the disk or
/// for a CPU, or nothing ran at all.
struct HeldBack {
  std::int64_t time_ns = 0;
  std::int64_t total_ns = 0;  ///< Since the first sample.
};

/// A run that was killed.
struct Run {
  std::filesystem::path folder;
  std::filesystem::path file;
  std::int64_t killed_ns = 0;
  std::vector<HeldBack> held_back = {};  ///< A sample each millisecond.
  std::map<std::string, std::unique_ptr<MappedPage>> pages = {};
  std::map<std::string, Found> found = {};
};

/// What came of all runs.
struct Tally {
  std::uint64_t kills = 0;
  std::uint64_t files_of_npm = 0;
  std::uint64_t messages = 0;
  std::uint64_t bytes = 0;
  std::int64_t recorded_ns = 0;
  std::vector<std::int64_t> missed_ns;  ///< Of each run: from the first missing message on.
  std::uint64_t late = 0;               ///< Runs that miss more than `kMayMiss`.
};

void wait_for_first_message(const Run& run, Process& program) {
  const std::int64_t end_ns = now_ns() + 20'000 * kMillisecond;
  const auto is_there = [](const auto& page) { return (*page.second)->last.load() > 0; };
  while (!std::ranges::all_of(run.pages, is_there)) {
    if (now_ns() > end_ns) {
      program.send(SIGKILL);
      program.wait();
      throw Failure("nothing was published within 20 s: " + program.errors());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

/// Most runs are short, so that there are many. One of seven goes on until the file was synced.
std::int64_t choose_delay_ns(std::mt19937_64& random) {
  const bool is_long = random() % 7 == 0;
  const std::int64_t from = is_long ? 900 * kMillisecond : 10 * kMillisecond;
  const std::int64_t to = is_long ? 2200 * kMillisecond : 350 * kMillisecond;
  return std::uniform_int_distribution<std::int64_t>(from, to)(random);
}

/// Puts the process ahead of what else the machine does, which is not what is tried here: the
/// recorder shares the CPUs with that like any other program. Not everybody may; then it does.
void put_ahead(pid_t process) {
  std::ofstream(fmt::format("/proc/{}/autogroup", process)) << -15;  // It has a session of its own.
}

/// A thread of the recorder, as the kernel accounts for it.
class RecorderThread {
 public:
  explicit RecorderThread(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Nanoseconds for which it was ready to run and had no CPU.
  std::int64_t waited_for_cpu_ns() const {
    std::int64_t ran_ns = 0;
    std::int64_t waited_ns = 0;
    std::ifstream(folder_ / "schedstat") >> ran_ns >> waited_ns;
    return waited_ns;
  }

  bool waits_for_disk() const {
    std::string id;
    std::string name;  // Has no space.
    std::string state;
    std::ifstream(folder_ / "stat") >> id >> name >> state;
    return state == "D";
  }

 private:
  std::filesystem::path folder_;
};

std::vector<RecorderThread> recorder_threads_of(pid_t process) {
  std::vector<RecorderThread> threads;
  for (const auto& task :
       std::filesystem::directory_iterator(fmt::format("/proc/{}/task", process))) {
    std::string name;
    std::ifstream(task.path() / "comm") >> name;
    if (name == "record-take" || name == "record-write") {
      threads.emplace_back(task.path());
    }
  }
  if (threads.size() != 2) {
    throw Failure(fmt::format("expected 2 threads of the recorder, found {}", threads.size()));
  }
  return threads;
}

/// Sleeps, and notes each millisecond how long the machine held the process's recorder back.
std::vector<HeldBack> watch(pid_t process, std::int64_t duration_ns) {
  const std::vector<RecorderThread> threads = recorder_threads_of(process);
  const auto waited_for_cpu_ns = [&] {
    std::int64_t sum_ns = 0;
    for (const RecorderThread& thread : threads) {
      sum_ns += thread.waited_for_cpu_ns();
    }
    return sum_ns;
  };
  const std::int64_t end_ns = now_ns() + duration_ns;
  std::vector<HeldBack> samples{{.time_ns = now_ns()}};
  std::int64_t cpu_ns = waited_for_cpu_ns();
  while (now_ns() < end_ns) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const HeldBack& before = samples.back();
    const std::int64_t time_ns = now_ns();
    const std::int64_t elapsed_ns = time_ns - before.time_ns;
    const std::int64_t cpu_before_ns = std::exchange(cpu_ns, waited_for_cpu_ns());
    const bool all = elapsed_ns > 5 * kMillisecond ||  // Not even this thread ran.
                     std::ranges::any_of(threads, &RecorderThread::waits_for_disk);
    const std::int64_t held_ns = all ? elapsed_ns : std::min(elapsed_ns, cpu_ns - cpu_before_ns);
    samples.push_back({.time_ns = time_ns, .total_ns = before.total_ns + held_ns});
  }
  return samples;
}

/// How long the recorder was held back in the time before the kill.
std::int64_t held_back_ns(const Run& run, std::int64_t before_kill_ns) {
  const std::int64_t from_ns = run.killed_ns - before_kill_ns;
  const auto first = std::ranges::find_if(
      run.held_back, [&](const HeldBack& sample) { return sample.time_ns >= from_ns; });
  if (first == run.held_back.end()) {
    return 0;
  }
  const std::int64_t already_ns = first == run.held_back.begin() ? 0 : std::prev(first)->total_ns;
  return run.held_back.back().total_ns - already_ns;
}

/// Records and kills; the pages say what was published.
Run record_and_kill(const std::string& program, const std::filesystem::path& folder,
                    std::mt19937_64& random) {
  std::filesystem::create_directories(folder);
  write_application(folder, random);
  Run run{.folder = folder, .file = folder / "drive.mcap.active"};
  for (const Stream& stream : kStreams) {
    run.pages[stream.topic] = std::make_unique<MappedPage>(page_of(folder, stream.topic).string());
  }
  Process process(
      {.program = program, .arguments = {"run", (folder / "app.json").string(), "--quiet"}});
  wait_for_first_message(run, process);
  put_ahead(process.pid());
  run.held_back = watch(process.pid(), choose_delay_ns(random));
  run.killed_ns = now_ns();
  process.send(SIGKILL);
  if (const test::Ending& ending = process.wait(); ending.signal != SIGKILL) {
    throw Failure(fmt::format("it ended by itself, with {}: {}", ending.exit_code,
                              process.errors() + process.output()));
  }
  return run;
}

void take(Found& found, const std::string& topic, const mcap::Message& message) {
  benchmark::Payload payload;
  if (!payload.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    throw Failure(fmt::format("{}: message {} is no Payload", topic, message.sequence));
  }
  ++found.last;
  if (message.sequence != found.last || payload.number() != static_cast<std::int64_t>(found.last)) {
    throw Failure(fmt::format("{}: expected message {}, found {} with number {}", topic, found.last,
                              message.sequence, payload.number()));
  }
  const auto expected = static_cast<char>(1 + found.last % 255);
  if (payload.data().front() != expected || payload.data().back() != expected) {
    throw Failure(fmt::format("{}: message {} has other content", topic, message.sequence));
  }
  found.bytes += message.data.size();
}

/// Reads the file from its beginning to where it was cut off; all CRCs are checked meanwhile.
void read(Run& run) {
  const mcap::FileSource source(run.file);
  mcap::RecordReader reader(source);
  std::uint64_t chunk_offset = 0;
  while (const auto record = reader.next()) {
    if (std::holds_alternative<mcap::Chunk>(*record)) {
      chunk_offset = reader.place().offset;
    }
    const auto* const message = std::get_if<mcap::Message>(&*record);
    if (message == nullptr) {
      continue;
    }
    const std::string& topic = reader.definitions().find_channel(message->channel_id)->topic;
    if (topic.starts_with("fastcycle/")) {
      continue;
    }
    Found& found = run.found[topic];
    take(found, topic, *message);
    if (reader.place().offset == chunk_offset) {
      ++found.in_whole_chunks;
    }
  }
  const mcap::Stop& stop = *reader.stop();
  if (stop.reason != mcap::Stop::Reason::kTruncated) {
    throw Failure("expected a file that is only cut off, found: " + to_string(stop.problem));
  }
  std::array<std::byte, 64> tail{};
  source.read(source.size() - tail.size(), tail);
  if (std::ranges::all_of(tail, [](std::byte byte) { return byte == std::byte{}; })) {
    throw Failure("the file ends with zeros");
  }
}

/// Opens it as any tool would.
void open_by_index(const Run& run) {
  const mcap::FileSource source(run.file);
  const mcap::Reader reader(source);
  std::uint64_t messages = 0;
  for (const auto& [id, count] : reader.statistics()->channel_message_counts) {
    const bool is_own = reader.definitions().find_channel(id)->topic.starts_with("fastcycle/");
    messages += is_own ? 0 : count;
  }
  std::uint64_t expected = 0;
  for (const auto& [topic, found] : run.found) {
    expected += found.last;
  }
  if (messages != expected || !reader.problem()) {
    throw Failure(
        fmt::format("expected {} messages of a file without an end, found {}", expected, messages));
  }
}

/// Everything whose `publish` returned long enough before the kill must be in a whole chunk.
/// Returns how long before it the first missing message was published.
std::int64_t judge(Run& run) {
  std::int64_t missed_ns = 0;
  std::string text;
  for (const auto& [topic, page] : run.pages) {
    const std::uint64_t published = (*page)->last.load();
    const std::uint64_t first_missing = run.found[topic].in_whole_chunks + 1;
    if (first_missing <= published) {
      const std::int64_t age_ns = run.killed_ns - (*page)->time_of(first_missing);
      missed_ns = std::max(missed_ns, age_ns);
      text += fmt::format("; {}: {} from {} on, {} ms before the kill", topic,
                          published + 1 - first_missing, first_missing, age_ns / kMillisecond);
    }
  }
  if (missed_ns > kMostMissed) {
    throw Failure("too much is missing" + text);
  }
  if (missed_ns > kMayMiss) {
    fmt::print("recorder: {}{}; for {} ms of these the machine held the recorder back\n",
               run.folder.string(), text, held_back_ns(run, missed_ns) / kMillisecond);
  }
  return missed_ns;
}

/// Lets the reader of npm count, which gives whole chunks only.
void compare_with_npm(const std::vector<Run>& runs, const std::string& node,
                      const std::string& script) {
  std::vector<std::string> words{script, "count"};
  for (const Run& run : runs) {
    words.push_back(run.file.string());
  }
  Process process({.program = node, .arguments = words});
  if (const test::Ending& ending = process.wait(); ending.exit_code != 0) {
    throw Failure("the reader of npm failed: " + process.errors());
  }
  std::map<std::string, json> files;
  std::size_t begin = 0;
  while (begin < process.output().size()) {
    const std::size_t end = process.output().find('\n', begin);
    const json line = json::parse(process.output().substr(begin, end - begin));
    files[line.at("file")] = line;
    begin = end + 1;
  }
  for (const Run& run : runs) {
    const json& line = files.at(run.file.string());
    if (line.at("error") != nullptr) {
      throw Failure(
          fmt::format("{}: the reader of npm says {}", run.file.string(), line.at("error").dump()));
    }
    for (const auto& [topic, found] : run.found) {
      const std::uint64_t count = line.at("topics").value(topic, std::uint64_t{0});
      if (count != found.in_whole_chunks) {
        throw Failure(fmt::format("{}, {}: expected {} messages, the reader of npm found {}",
                                  run.file.string(), topic, found.in_whole_chunks, count));
      }
    }
  }
}

void add(Tally& tally, const Run& run, std::int64_t missed_ns) {
  ++tally.kills;
  tally.missed_ns.push_back(missed_ns);
  tally.late += missed_ns - held_back_ns(run, missed_ns) > kMayMiss ? 1 : 0;
  std::int64_t first_ns = run.killed_ns;
  for (const auto& [topic, page] : run.pages) {
    const std::uint64_t last = (*page)->last.load();
    const std::uint64_t oldest = last < Page::kMostTimes ? 1 : last - Page::kMostTimes + 1;
    first_ns = std::min(first_ns, (*page)->time_of(oldest));
  }
  tally.recorded_ns += run.killed_ns - first_ns;
  for (const auto& [topic, found] : run.found) {
    tally.messages += found.last;
    tally.bytes += found.bytes;
  }
}

void print(Tally tally) {
  std::ranges::sort(tally.missed_ns);
  const auto at = [&](double share) {
    const auto last = static_cast<double>(tally.missed_ns.size() - 1);
    return static_cast<double>(tally.missed_ns[static_cast<std::size_t>(last * share)]) / 1e6;
  };
  fmt::print(
      "recorder: {} kills at {:.0f} MB/s on average ({:.1f} GB, {} messages in the files); "
      "missing: "
      "the last {:.1f} ms (p50), {:.1f} ms (p99), {:.1f} ms (most), {} times above {} ms; "
      "read by npm too: {} files\n",
      tally.kills, static_cast<double>(tally.bytes) * 1e3 / static_cast<double>(tally.recorded_ns),
      static_cast<double>(tally.bytes) / 1e9, tally.messages, at(0.5), at(0.99), at(1), tally.late,
      kMayMiss / kMillisecond, tally.files_of_npm);
}

struct Words {
  std::string program;
  std::filesystem::path folder;
  std::int64_t seconds = 0;
  std::string node = {};
  std::string script = {};
};

void kill_until_the_time_is_over(const Words& words) {
  std::mt19937_64 random(std::random_device{}());
  const std::int64_t end_ns = now_ns() + words.seconds * 1'000 * kMillisecond;
  Tally tally;
  while (now_ns() < end_ns) {
    std::vector<Run> runs;
    for (std::size_t i = 0; i < kBatch && now_ns() < end_ns; ++i) {
      const std::filesystem::path folder = words.folder / fmt::format("run_{}", tally.kills);
      try {
        runs.push_back(record_and_kill(words.program, folder, random));
        read(runs.back());
        open_by_index(runs.back());
        add(tally, runs.back(), judge(runs.back()));
      } catch (const std::exception& error) {
        throw Failure(
            fmt::format("kill {}, {}: {}", tally.kills + 1, folder.string(), error.what()));
      }
    }
    if (!words.node.empty()) {
      compare_with_npm(runs, words.node, words.script);
      tally.files_of_npm += runs.size();
    }
    for (const Run& run : runs) {
      std::filesystem::remove_all(run.folder);
    }
  }
  print(tally);
  if (tally.late * 20 > std::max<std::uint64_t>(tally.kills, 20)) {
    throw Failure(fmt::format("{} of {} runs miss more than the last {} ms", tally.late,
                              tally.kills, kMayMiss / kMillisecond));
  }
}

}  // namespace
}  // namespace fastcycle::recorder_test

int main(int count, char** arguments) {
  if (count != 4 && count != 6) {
    std::fputs("usage: fastcycle_recorder_kills PROGRAM FOLDER SECONDS [NODE SCRIPT]\n", stderr);
    return 2;
  }
  try {
    fastcycle::recorder_test::Words words{.program = arguments[1],
                                          .folder = std::filesystem::absolute(arguments[2]),
                                          .seconds = std::atol(arguments[3])};
    if (count == 6) {
      words.node = arguments[4];
      words.script = arguments[5];
    }
    fastcycle::recorder_test::kill_until_the_time_is_over(words);
  } catch (const std::exception& error) {
    fmt::print(stderr, "fastcycle_recorder_kills: {}\n", error.what());
    return 1;
  }
  return 0;
}
