#include "record/flight_ring.h"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "mcap/error.h"

namespace fastcycle::record {
namespace {

using testing::HasSubstr;

/// What a record of this number has: its size and its bytes follow from the number.
std::string content_of(std::uint64_t number, std::uint64_t longest) {
  std::string text(static_cast<std::size_t>(number * 37 % (longest + 1)), '\0');
  for (std::size_t i = 0; i < text.size(); ++i) {
    text[i] = static_cast<char>('a' + (number + i) % 26);
  }
  return text;
}

void append(FlightRing& ring, std::uint64_t number, std::uint64_t longest) {
  const std::string text = content_of(number, longest);
  // In two parts, as messages are.
  const std::vector<mcap::Bytes> parts{mcap::bytes_of(text).first(text.size() / 3),
                                       mcap::bytes_of(text).subspan(text.size() / 3)};
  ASSERT_TRUE(ring.append(7, static_cast<std::int64_t>(number) * 10, parts));
}

/// The numbers that `reader` gives, each of which has the right content.
std::vector<std::uint64_t> numbers_of(FlightRingReader& reader, std::uint64_t longest) {
  std::vector<std::uint64_t> numbers;
  while (const std::optional<FlightRecord> record = reader.next()) {
    EXPECT_EQ(record->kind, 7);
    EXPECT_EQ(record->time_ns, static_cast<std::int64_t>(record->number) * 10);
    EXPECT_EQ(mcap::text_of(record->data), content_of(record->number, longest));
    numbers.push_back(record->number);
  }
  return numbers;
}

std::vector<std::uint64_t> numbers_from(std::uint64_t first, std::uint64_t count) {
  std::vector<std::uint64_t> numbers;
  for (std::uint64_t i = 0; i < count; ++i) {
    numbers.push_back(first + i);
  }
  return numbers;
}

std::string bytes_in(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Memory that a child process shares with the test.
class SharedNumber {
 public:
  SharedNumber()
      : number_(new(mmap(nullptr, sizeof(Number), PROT_READ | PROT_WRITE,
                         MAP_SHARED | MAP_ANONYMOUS, -1, 0)) Number(0)) {}
  ~SharedNumber() { munmap(number_, sizeof(Number)); }
  SharedNumber(const SharedNumber&) = delete;
  SharedNumber& operator=(const SharedNumber&) = delete;

  std::atomic<std::uint64_t>& operator*() const { return *number_; }

 private:
  using Number = std::atomic<std::uint64_t>;
  Number* number_;
};

class Ring : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "fastcycle_ring_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    file_ = folder_ / "drive.ring";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] FlightRing::Options options(std::uint64_t bytes) const {
    return {.file = file_, .bytes = bytes, .start_ns = 42};
  }

  /// The error of making a ring; empty if it could be made.
  [[nodiscard]] std::string error_of_making(std::uint64_t bytes = 8192) const {
    try {
      const FlightRing ring(options(bytes), {});
      return {};
    } catch (const mcap::Error& error) {
      return error.what();
    }
  }

  [[nodiscard]] std::string error_of_reading() const {
    try {
      FlightRingReader reader(file_);
      return {};
    } catch (const mcap::Error& error) {
      return error.what();
    }
  }

  std::filesystem::path folder_;
  std::filesystem::path file_;
};

TEST_F(Ring, HasWhatWasAppendedAndWhatExplainsIt) {
  {
    FlightRing ring(options(64 << 10), mcap::bytes_of("explained"));
    for (std::uint64_t i = 0; i < 20; ++i) {
      append(ring, i, 200);
    }
    ring.count_wake();
    ring.close();
  }
  FlightRingReader reader(file_);
  EXPECT_EQ(mcap::text_of(reader.explanation()), "explained");
  EXPECT_EQ(reader.start_ns(), 42);
  EXPECT_EQ(reader.pid(), static_cast<std::uint32_t>(getpid()));
  EXPECT_EQ(reader.boot_id().size(), 36U);
  EXPECT_EQ(reader.wakes(), 1U);
  EXPECT_TRUE(reader.is_closed());
  EXPECT_EQ(numbers_of(reader, 200), numbers_from(0, 20));
  EXPECT_EQ(reader.missing(), 0U);
  struct stat status{};
  ASSERT_EQ(stat(file_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST_F(Ring, GivesUpTheOldestForTheNewest) {
  for (const std::uint64_t longest : {0U, 1U, 39U, 500U, 1900U}) {
    {
      FlightRing ring(options(4096), {});
      for (std::uint64_t i = 0; i < 1000; ++i) {
        append(ring, i, longest);
      }
    }
    FlightRingReader reader(file_);
    EXPECT_FALSE(reader.is_closed());
    const std::vector<std::uint64_t> numbers = numbers_of(reader, longest);
    ASSERT_FALSE(numbers.empty());
    EXPECT_EQ(numbers, numbers_from(1000 - numbers.size(), numbers.size())) << longest;
    // No more is given up than has to be: two of the largest, and one that did not fit at the end.
    EXPECT_GE((numbers.size() + 3) * (40 + longest + 7), 4096U) << longest;
  }
}

TEST_F(Ring, RefusesWhatIsLargerThanHalfOfIt) {
  FlightRing ring(options(4096), {});
  const std::string large(2048, 'x');
  const mcap::Bytes part = mcap::bytes_of(large);
  EXPECT_FALSE(ring.append(7, 0, {&part, 1}));
  const mcap::Bytes fits = part.first(2008);
  EXPECT_TRUE(ring.append(7, 0, {&fits, 1}));
}

TEST_F(Ring, TakesThePlaceOfOneThatNobodyWrites) {
  {
    FlightRing ring(options(8192), {});
    append(ring, 0, 10);
  }
  EXPECT_EQ(error_of_making(), "");
  FlightRingReader reader(file_);
  EXPECT_FALSE(reader.next());
}

TEST_F(Ring, LeavesAloneWhatIsNone) {
  std::ofstream(file_) << "precious";
  EXPECT_THAT(error_of_making(), HasSubstr("drive.ring"));
  EXPECT_THAT(error_of_making(), HasSubstr("left alone"));
  EXPECT_EQ(bytes_in(file_), "precious");
  EXPECT_THAT(error_of_reading(), HasSubstr("8 bytes"));
  EXPECT_FALSE(begins_as_ring(file_));
}

TEST_F(Ring, FollowsNoLink) {
  std::ofstream(folder_ / "target") << "precious";
  std::filesystem::create_symlink(folder_ / "target", file_);
  EXPECT_THAT(error_of_making(), HasSubstr("symbolic link"));
  EXPECT_THAT(error_of_reading(), HasSubstr("symbolic link"));
  EXPECT_EQ(bytes_in(folder_ / "target"), "precious");
  std::filesystem::remove(file_);
  std::filesystem::create_symlink(folder_ / "nowhere", file_);
  EXPECT_THAT(error_of_making(), HasSubstr("symbolic link"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "nowhere"));
}

TEST_F(Ring, IsOfOneWriter) {
  const FlightRing ring(options(8192), {});
  EXPECT_THAT(error_of_making(), HasSubstr("one that a process writes"));
  EXPECT_THAT(error_of_reading(), HasSubstr("one that a process writes"));
}

TEST_F(Ring, SaysThatAFolderIsMissing) {
  file_ = folder_ / "none" / "drive.ring";
  EXPECT_THAT(error_of_making(), HasSubstr("No such file"));
}

// A limit of the process stands for a full disk: both are found when the file is allocated.
TEST_F(Ring, SaysAtTheStartThatThereIsNoRoom) {
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 1 << 20, .rlim_max = before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  const std::string error = error_of_making(4 << 20);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);

  EXPECT_THAT(error, HasSubstr("expected room for a ring of 4198400 bytes"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(Ring, IsReadWhileItIsWritten) {
  constexpr std::uint64_t kCount = 50'000;
  FlightRing ring(options(64 << 10), {});
  // Each reader is made by the thread that appends; the test reads beside it.
  std::atomic<FlightRingReader*> given{nullptr};
  std::atomic<bool> is_over{false};
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < kCount; ++i) {
      append(ring, i, 900);
      if (i % 500 == 499 && given.load() == nullptr) {
        const FlightMark from;
        given.store(new FlightRingReader(ring, from));
      }
    }
    is_over.store(true);
  });
  std::uint64_t readers = 0;
  while (!is_over.load() || given.load() != nullptr) {
    FlightRingReader* const reader = given.load();
    if (reader == nullptr) {
      std::this_thread::yield();
      continue;
    }
    const std::vector<std::uint64_t> numbers = numbers_of(*reader, 900);
    const std::set<std::uint64_t> different(numbers.begin(), numbers.end());
    EXPECT_TRUE(std::ranges::is_sorted(numbers));
    EXPECT_EQ(different.size(), numbers.size());
    // It was made behind a whole number of five hundreds.
    EXPECT_EQ((numbers.size() + reader->missing()) % 500, 0U);
    delete reader;
    given.store(nullptr);
    ++readers;
  }
  writer.join();
  EXPECT_GT(readers, 0U);
}

TEST_F(Ring, CountsWhatWasOverwrittenBeforeItWasRead) {
  FlightRing ring(options(4096), {});
  append(ring, 0, 100);
  const FlightMark from = ring.mark();
  for (std::uint64_t i = 1; i < 10; ++i) {
    append(ring, i, 100);
  }
  FlightRingReader late(ring, from);
  for (std::uint64_t i = 10; i < 500; ++i) {
    append(ring, i, 100);
  }
  EXPECT_FALSE(late.next());
  EXPECT_EQ(late.missing(), 9U);
  FlightRingReader now(ring, from);
  const std::vector<std::uint64_t> numbers = numbers_of(now, 100);
  EXPECT_EQ(numbers, numbers_from(500 - numbers.size(), numbers.size()));
  EXPECT_EQ(now.missing(), 499 - numbers.size());
}

// ---- Kills ----

/// In a child: writes records until it is killed, and counts how many it has written.
[[noreturn]] void write_until_killed(const FlightRing::Options& options,
                                     std::atomic<std::uint64_t>& written, std::uint64_t longest) {
  FlightRing ring(options, {});
  for (std::uint64_t i = 0;; ++i) {
    append(ring, i, longest);
    written.store(i + 1);
  }
}

TEST_F(Ring, HasEveryRecordThatWasWrittenWhenItsProcessIsKilled) {
  constexpr std::uint64_t kLongest = 3000;
  std::mt19937 random(4711);  // NOLINT: the same kills in every run.
  for (int kill_count = 0; kill_count < 20; ++kill_count) {
    const SharedNumber written;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      write_until_killed(options(256 << 10), *written, kLongest);
    }
    const std::uint64_t enough = std::uniform_int_distribution<std::uint64_t>(1, 3000)(random);
    while ((*written).load() < enough) {
      std::this_thread::yield();
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);

    FlightRingReader reader(file_);
    EXPECT_FALSE(reader.is_closed());
    EXPECT_EQ(reader.pid(), static_cast<std::uint32_t>(child));
    const std::vector<std::uint64_t> numbers = numbers_of(reader, kLongest);
    ASSERT_FALSE(numbers.empty());
    EXPECT_EQ(numbers, numbers_from(numbers.front(), numbers.size()));
    EXPECT_EQ(reader.missing(), 0U);
    // One more may be there than the child could still count.
    EXPECT_GE(numbers.back() + 1, (*written).load());
    EXPECT_LE(numbers.back() + 1, (*written).load() + 1);
  }
}

/// The numbers in the file at present, whoever writes it.
std::vector<std::uint64_t> numbers_now(const std::filesystem::path& file,
                                       const std::filesystem::path& copy, std::uint64_t longest) {
  std::filesystem::copy_file(file, copy, std::filesystem::copy_options::overwrite_existing);
  FlightRingReader reader(copy);
  return numbers_of(reader, longest);
}

// A child writes, and is stopped after every single instruction.
TEST_F(Ring, IsWholeAtEveryInstructionOfItsWriter) {
  constexpr std::uint64_t kLongest = 400;
  constexpr std::uint64_t kRecords = 24;  // More than fit.
  const SharedNumber written;
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    FlightRing ring(options(4096), {});
    std::vector<std::string> contents;
    for (std::uint64_t i = 0; i < kRecords; ++i) {
      contents.push_back(content_of(i, kLongest));
    }
    if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) {
      _exit(1);
    }
    raise(SIGSTOP);
    for (std::uint64_t i = 0; i < kRecords; ++i) {
      const mcap::Bytes part = mcap::bytes_of(contents[i]);
      ring.append(7, static_cast<std::int64_t>(i) * 10, {&part, 1});
      (*written).store(i + 1);
    }
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFSTOPPED(status)) {
    GTEST_SKIP() << "a process cannot be traced here";
  }
  // Looking is slower than a step: every instruction is made, and some of them are looked at; which
  // ones differs from run to run.
  std::mt19937 random(std::random_device{}());
  std::uint64_t steps = 0;
  std::uint64_t looks = 0;
  while (ptrace(PTRACE_SINGLESTEP, child, nullptr, nullptr) == 0 &&
         waitpid(child, &status, 0) == child && WIFSTOPPED(status)) {
    ++steps;
    if (random() % 20 != 0) {
      continue;
    }
    ++looks;
    const std::uint64_t counted = (*written).load();
    const std::vector<std::uint64_t> numbers = numbers_now(file_, folder_ / "copy.ring", kLongest);
    if (numbers.empty()) {
      EXPECT_EQ(counted, 0U);
      continue;
    }
    EXPECT_EQ(numbers, numbers_from(numbers.front(), numbers.size()));
    EXPECT_GE(numbers.back() + 1, counted);
    EXPECT_LE(numbers.back() + 1, counted + 1);
  }
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_EQ((*written).load(), kRecords);
  EXPECT_GT(steps, 10 * kRecords);
  EXPECT_GT(looks, 0U);
}

// ---- What others do to the file ----

TEST_F(Ring, GoesOnInMemoryWhenItsFileIsCutOff) {
  constexpr std::uint64_t kLongest = 300;
  FlightRing ring(options(64 << 10), mcap::bytes_of("explained"));
  for (std::uint64_t i = 0; i < 50; ++i) {
    append(ring, i, kLongest);
  }
  ASSERT_EQ(truncate(file_.c_str(), 0), 0);
  EXPECT_EQ(ring.look().kind, base::FileState::Kind::kLost);

  ring.count_wake();
  ASSERT_TRUE(ring.is_cut());
  ring.forget();
  const FlightMark mark = ring.mark();
  for (std::uint64_t i = 50; i < 100; ++i) {
    append(ring, i, kLongest);
  }

  FlightRingReader reader(ring, mark);
  EXPECT_EQ(mcap::text_of(reader.explanation()), "explained");
  EXPECT_EQ(numbers_of(reader, kLongest), numbers_from(50, 50));
}

TEST_F(Ring, ThatIsCutOffWhileItIsReadGivesNothingThatIsNotThere) {
  FlightRing ring(options(64 << 10), {});
  const FlightMark mark = ring.mark();
  for (std::uint64_t i = 0; i < 50; ++i) {
    append(ring, i, 300);
  }
  FlightRingReader reader(ring, mark);
  ASSERT_EQ(truncate(file_.c_str(), 0), 0);

  EXPECT_FALSE(reader.next().has_value());
}

TEST_F(Ring, IsFreeForTheNextRunAlsoWhileAForkedChildLives) {
  std::optional<FlightRing> ring(std::in_place, options(8192), mcap::Bytes{});
  const SharedNumber is_there;
  int wait_for_end[2] = {};
  ASSERT_EQ(pipe(wait_for_end), 0);
  const pid_t child = fork();
  if (child == 0) {
    *is_there = 1;
    close(wait_for_end[1]);
    char ignored = 0;
    static_cast<void>(!read(wait_for_end[0], &ignored, 1));
    _exit(0);
  }
  while ((*is_there).load() == 0) {
    std::this_thread::yield();
  }
  EXPECT_THAT(error_of_making(), HasSubstr("one that a process writes"));
  ring.reset();

  EXPECT_EQ(error_of_making(), "");

  close(wait_for_end[0]);
  close(wait_for_end[1]);
  waitpid(child, nullptr, 0);
}

// ---- Damage ----

class DamagedRing : public Ring {
 protected:
  static constexpr std::uint64_t kLongest = 300;

  void SetUp() override {
    Ring::SetUp();
    FlightRing ring(options(8192), mcap::bytes_of("explained"));
    for (std::uint64_t i = 0; i < 200; ++i) {
      append(ring, i, kLongest);
    }
  }

  void write(const std::string& bytes) const {
    std::filesystem::remove(file_);
    std::ofstream(file_, std::ios::binary) << bytes;
  }

  /// The numbers of the records of the file; none if it is refused. Their content is right.
  [[nodiscard]] std::vector<std::uint64_t> read() const {
    try {
      FlightRingReader reader(file_);
      return numbers_of(reader, kLongest);
    } catch (const mcap::Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("drive.ring"));
      return {};
    }
  }
};

TEST_F(DamagedRing, GivesNoMoreThanIsWholeWhateverByteIsWrong) {
  const std::vector<std::uint64_t> all = read();
  ASSERT_GT(all.size(), 10U);
  const std::string whole = bytes_in(file_);
  std::size_t worst = all.size();
  for (std::size_t at = 0; at < whole.size(); at += at < 4096 ? 1 : 37) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x55);
    write(bytes);
    const std::vector<std::uint64_t> numbers = read();
    EXPECT_TRUE(std::ranges::includes(all, numbers)) << at;
    if (at >= 8192) {  // Among the records: one is gone, the others are there.
      worst = std::min(worst, numbers.size());
    }
  }
  EXPECT_EQ(worst, all.size() - 1);
}

TEST_F(DamagedRing, IsRefusedWhereverItIsCutOff) {
  const std::string whole = bytes_in(file_);
  for (std::size_t size = 0; size < whole.size(); size += 61) {
    write(whole.substr(0, size));
    EXPECT_NE(error_of_reading(), "") << size;
  }
  write(whole + "more");
  EXPECT_NE(error_of_reading(), "");
}

TEST_F(DamagedRing, GivesNothingThatWasNotWrittenWhateverStandsInIt) {
  const std::vector<std::uint64_t> all = read();
  const std::string whole = bytes_in(file_);
  std::mt19937 random(815);  // NOLINT: the same damage in every run.
  for (int round = 0; round < 300; ++round) {
    std::string bytes = whole;
    // The header stays as it is, or nothing of it would be read.
    const auto begin = static_cast<std::ptrdiff_t>(
        std::uniform_int_distribution<std::size_t>(8192, whole.size() - 1)(random));
    const auto count = static_cast<std::ptrdiff_t>(std::uniform_int_distribution<std::size_t>(
        1, whole.size() - static_cast<std::size_t>(begin))(random));
    const bool is_copy = round % 2 == 0;
    for (std::ptrdiff_t i = begin; i < begin + count; ++i) {
      // Records in another place, or nothing that makes sense.
      bytes[static_cast<std::size_t>(i)] =
          is_copy ? whole[8192 + static_cast<std::size_t>(i - begin)] : static_cast<char>(random());
    }
    write(bytes);
    EXPECT_TRUE(std::ranges::includes(all, read())) << round;
  }
}

// ---- A crash ----

TEST_F(Ring, WhatACrashNotesIsReadBackWithItsTextsEnded) {
  {
    FlightRing ring(options(8192), {});
    append(ring, 0, 100);
    diagnostics::CrashNote& note = ring.crash_note();
    note.activation.number = 12;
    note.component.fill('c');
    std::ranges::copy(std::string_view("in words"), note.summary.begin());
    note.text_size = 1'000'000;
    note.magic = diagnostics::CrashNote::kMagic;
  }
  const FlightRingReader reader(file_);
  ASSERT_TRUE(reader.crash_note().has_value());
  EXPECT_EQ(reader.crash_note()->activation.number, 12U);
  EXPECT_EQ(std::string(reader.crash_note()->component.data()), std::string(63, 'c'));
  EXPECT_STREQ(reader.crash_note()->summary.data(), "in words");
  EXPECT_EQ(reader.crash_note()->text_size, reader.crash_note()->text.size());
}

TEST_F(Ring, WithoutACrashThereIsNoNote) {
  {
    FlightRing(options(8192), {});
  }
  EXPECT_FALSE(FlightRingReader(file_).crash_note().has_value());
}

TEST_F(Ring, AChildDoesNotKeepItsLock) {
  auto ring = std::make_unique<FlightRing>(options(8192), mcap::Bytes());
  int gate[2];
  int news[2];
  ASSERT_EQ(pipe(gate), 0);
  ASSERT_EQ(pipe(news), 0);
  char one = 0;
  const pid_t child = fork();
  if (child == 0) {
    close(gate[1]);
    const bool is_written = write(news[1], &one, 1) == 1;
    _exit(is_written && read(gate[0], &one, 1) == 0 ? 0 : 1);
  }
  ASSERT_EQ(read(news[0], &one, 1), 1);
  ring.reset();
  EXPECT_EQ(error_of_making(), "");  // While the child lives.
  close(gate[1]);
  EXPECT_EQ(waitpid(child, nullptr, 0), child);
  for (const int descriptor : {gate[0], news[0], news[1]}) {
    close(descriptor);
  }
}

}  // namespace
}  // namespace fastcycle::record
