#include "dds_gateway/doctor/round_trip.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 1s;  // For one message.
constexpr auto kServe = 200ms;  // Maximum delay of the other process's end.
constexpr std::array<std::byte, 4> kEncapsulation = {std::byte{0}, std::byte{1}, std::byte{0},
                                                     std::byte{0}};

Endpoint endpoint_of(const std::string& topic, bool is_reader) {
  return {.topic = topic,
          .type = "fastcycle_msgs::msg::dds_::Doctor_",
          .user_data = {},
          .qos = {.is_reliable = true, .is_transient_local = false, .depth = 4},
          .is_reader = is_reader};
}

/// Kills and reaps the other process.
void end_process(pid_t process) {
  for (int i = 0; i < 100; ++i) {
    if (waitpid(process, nullptr, WNOHANG) != 0) {
      return;
    }
    std::this_thread::sleep_for(20ms);
  }
  (void)kill(process, SIGKILL);
  (void)waitpid(process, nullptr, 0);
}

}  // namespace

RoundTrip::RoundTrip(Participant& participant, const std::string& program,
                     std::vector<std::string> args) {
  const std::string base = fmt::format("rt/fastcycle_doctor_{}/", getpid());
  writer_ = participant.create_writer(endpoint_of(base + "there", false));
  reader_ = participant.create_reader(
      endpoint_of(base + "back", true),
      [this](std::span<const std::byte> message, const SampleInfo&) { take(message); });

  args.insert(args.begin(), program);
  args.push_back(base + "there");
  args.push_back(base + "back");
  std::vector<char*> pointers;
  for (std::string& arg : args) {
    pointers.push_back(arg.data());
  }
  pointers.push_back(nullptr);
  std::array<int, 2> input{};
  if (pipe2(input.data(), O_CLOEXEC) != 0) {
    return;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input[0], STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  if (posix_spawn(&process_, program.c_str(), &actions, nullptr, pointers.data(), environ) != 0) {
    process_ = -1;
  }
  posix_spawn_file_actions_destroy(&actions);
  close(input[0]);
  input_ = input[1];
}

RoundTrip::~RoundTrip() {
  if (input_ >= 0) {
    close(input_);
  }
  if (process_ > 0) {
    end_process(process_);
  }
}

bool RoundTrip::is_done() const {
  return result_.small.size() >= kRounds && result_.large.size() >= kRounds;
}

RoundTripResult RoundTrip::result() const {
  RoundTripResult sorted = result_;
  std::ranges::sort(sorted.small);
  std::ranges::sort(sorted.large);
  return sorted;
}

void RoundTrip::step() {
  const auto now = Clock::now();
  if (result_.found_after < 0ms) {
    if (writer_->matched() == 0 || reader_->matched() == 0) {
      return;
    }
    result_.found_after = std::chrono::duration_cast<std::chrono::milliseconds>(now - begin_);
  }
  if (is_done() || (number_ != 0 && now - sent_ < kPatience)) {
    return;
  }
  // The first message may be sent before the other side has found its reader.
  const bool has_come = !result_.small.empty();
  result_.lost += number_ != 0 && has_come ? 1 : 0;
  send();
}

void RoundTrip::send() {
  ros2::Buffer message;
  const std::size_t size = result_.small.size() < kRounds ? kSmallBytes : kLargeBytes;
  std::byte* const to = message.grow(size);
  std::memset(to, 0, size);
  std::ranges::copy(kEncapsulation, to);
  number_ = ++last_;
  std::memcpy(to + kEncapsulation.size(), &number_, sizeof number_);
  sent_ = Clock::now();
  try {
    writer_->write(message);
  } catch (const EngineError&) {
    // Not sent, and retried after the timeout.
  }
}

void RoundTrip::take(std::span<const std::byte> message) {
  std::uint64_t number = 0;
  if (message.size() < kEncapsulation.size() + sizeof number) {
    return;
  }
  std::memcpy(&number, message.data() + kEncapsulation.size(), sizeof number);
  if (number == 0 || number != number_) {
    return;  // Late, or from another process.
  }
  const auto took = Clock::now() - sent_;
  auto& times = message.size() > kSmallBytes ? result_.large : result_.small;
  times.push_back(std::chrono::duration_cast<std::chrono::nanoseconds>(took));
  number_ = 0;
}

void RoundTrip::echo(Participant& participant, const std::string& from, const std::string& to) {
  const std::unique_ptr<Writer> writer = participant.create_writer(endpoint_of(to, false));
  const std::unique_ptr<Reader> reader = participant.create_reader(
      endpoint_of(from, true), [&](std::span<const std::byte> message, const SampleInfo&) {
        ros2::Buffer back;
        std::memcpy(back.grow(message.size()), message.data(), message.size());
        writer->write(back);
      });
  pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  while (poll(&input, 1, 0) == 0) {
    participant.serve(kServe);
    (void)participant.discoveries();
  }
}

}  // namespace fastcycle::dds_gateway
