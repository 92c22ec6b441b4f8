#include "record/guarded_file.h"

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fastcycle/version.h"

namespace fastcycle::record {
namespace {

constexpr std::uint64_t kSize = 16 * 4096;

class Guarded : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "fastcycle_guard_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = folder_ / "file";
    file_.emplace(make(path_), kSize);
  }
  void TearDown() override {
    file_.reset();
    std::filesystem::remove_all(folder_);
  }

  static int make(const std::filesystem::path& path) {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    EXPECT_EQ(::ftruncate(descriptor, kSize), 0);
    return descriptor;
  }
  /// How a child ended that did `body`: its exit code, or 1000 + the signal.
  template <typename Body>
  static int in_child(const Body& body) {
    const pid_t child = fork();
    if (child == 0) {
      const rlimit none{};
      ::setrlimit(RLIMIT_CORE, &none);
      _exit(body());
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFSIGNALED(status) ? 1000 + WTERMSIG(status) : WEXITSTATUS(status);
  }

  std::filesystem::path folder_;
  std::filesystem::path path_;
  std::optional<GuardedFile> file_;
};

TEST_F(Guarded, IsWhatOthersReadInTheFile) {
  std::memcpy(file_->memory() + 5000, "text", 4);

  char text[5] = {};
  EXPECT_EQ(::pread(file_->descriptor(), text, 4, 5000), 4);
  EXPECT_STREQ(text, "text");
  EXPECT_FALSE(file_->is_cut());
}

TEST_F(Guarded, MayBeCutOffWhileItIsWritten) {
  std::memset(file_->memory(), 'a', kSize);
  ASSERT_EQ(::truncate(path_.c_str(), 4096), 0);

  std::memset(file_->memory(), 'b', kSize);

  EXPECT_TRUE(file_->is_cut());
  EXPECT_EQ(file_->memory()[kSize - 1], std::byte{'b'});
  EXPECT_EQ(std::filesystem::file_size(path_), 4096U);
}

TEST_F(Guarded, IsOneOfSeveralThatAreCutOff) {
  std::optional<GuardedFile> other(std::in_place, make(folder_ / "other"), kSize);
  ASSERT_EQ(::truncate((folder_ / "other").c_str(), 0), 0);

  other->memory()[0] = std::byte{1};

  EXPECT_TRUE(other->is_cut());
  EXPECT_FALSE(file_->is_cut());
  other.reset();
  // The place of one that is gone is free again.
  other.emplace(make(folder_ / "other"), kSize);
  EXPECT_FALSE(other->is_cut());
}

TEST_F(Guarded, ABusErrorOfSomethingElseStillEndsTheProcess) {
  const int descriptor = make(folder_ / "plain");
  auto* const memory =
      static_cast<char*>(::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0));
  ASSERT_NE(memory, MAP_FAILED);
  ASSERT_EQ(::ftruncate(descriptor, 0), 0);

  if (std::string_view(FASTCYCLE_SANITIZER) == "none") {
    EXPECT_EQ(in_child([&] {
                memory[0] = 1;
                return 0;
              }),
              1000 + SIGBUS);
    EXPECT_EQ(in_child([] {
                ::raise(SIGBUS);
                return 0;
              }),
              1000 + SIGBUS);
  }
  ::munmap(memory, kSize);
  ::close(descriptor);
}

// As a reporter of crashes does it: it says what happened, and lets it happen once more.
TEST_F(Guarded, AHandlerThatWasThereBeforeReceivesOtherBusErrorsOnce) {
  if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
    GTEST_SKIP() << "a sanitizer has handlers of its own";
  }
  EXPECT_EQ(in_child([&] {
              static int calls = 0;
              static struct sigaction ours{};
              struct sigaction action{};
              action.sa_sigaction = [](int signal, siginfo_t*, void*) {
                if (++calls > 1) {
                  _exit(99);
                }
                ::sigaction(signal, &ours, nullptr);
              };
              action.sa_flags = SA_SIGINFO;
              ::sigaction(SIGBUS, &action, &ours);
              GuardedFile guarded(make(folder_ / "guarded"), kSize);
              static_cast<void>(!::truncate((folder_ / "guarded").c_str(), 0));
              guarded.memory()[0] = std::byte{1};
              if (!guarded.is_cut() || calls != 0) {
                _exit(98);
              }
              const int plain = make(folder_ / "plain");
              auto* const memory = static_cast<char*>(
                  ::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, plain, 0));
              static_cast<void>(!::ftruncate(plain, 0));
              memory[0] = 1;
              return 0;
            }),
            1000 + SIGBUS);
}

TEST_F(Guarded, IsNotHeldByAChild) {
  ASSERT_EQ(::flock(file_->descriptor(), LOCK_EX | LOCK_NB), 0);
  file_->memory()[0] = std::byte{'p'};
  const auto is_free = [&] {
    const int other = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
    const bool is_locked = ::flock(other, LOCK_EX | LOCK_NB) != 0;
    ::close(other);
    return !is_locked;
  };
  int is_there[2] = {};
  int wait_for_end[2] = {};
  ASSERT_EQ(::pipe(is_there), 0);
  ASSERT_EQ(::pipe(wait_for_end), 0);

  char ignored = 0;
  const pid_t child = fork();
  if (child == 0) {
    file_->memory()[0] = std::byte{'c'};
    ::close(wait_for_end[1]);
    static_cast<void>(!::write(is_there[1], "c", 1));
    static_cast<void>(!::read(wait_for_end[0], &ignored, 1));
    _exit(file_->descriptor() == -1 ? 0 : 1);
  }
  ASSERT_EQ(::read(is_there[0], &ignored, 1), 1);
  EXPECT_FALSE(is_free());
  file_.reset();
  EXPECT_TRUE(is_free());
  for (const int end : {is_there[0], is_there[1], wait_for_end[0], wait_for_end[1]}) {
    ::close(end);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  // Nor has the child written into it.
  char first = 0;
  const int other = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  EXPECT_EQ(::read(other, &first, 1), 1);
  EXPECT_EQ(first, 'p');
  ::close(other);
}

TEST_F(Guarded, WhatCannotBeMappedIsAnError) {
  EXPECT_THROW(GuardedFile(-1, kSize), std::system_error);
}

}  // namespace
}  // namespace fastcycle::record
