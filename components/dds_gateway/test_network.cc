#include "dds_gateway/test_network.h"

#include <array>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <spawn.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::dds_gateway {
namespace {

/// Before any test, and so before any thread exists.
class OwnNetwork final : public ::testing::Environment {
 public:
  void SetUp() override { enter_own_network(); }
};

const ::testing::Environment* const kOwnNetwork =
    ::testing::AddGlobalTestEnvironment(new OwnNetwork);

}  // namespace

void enter_own_network() {
  if (unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
    return;  // Falls back to the machine's loopback, with a domain of its own.
  }
  ifreq request{};
  std::strcpy(request.ifr_name, "lo");
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  request.ifr_flags = IFF_UP | IFF_LOOPBACK;
  (void)ioctl(socket, SIOCSIFFLAGS, &request);
  close(socket);
}

unsigned domain_of_test() {
  return 10U + static_cast<unsigned>(getpid()) % 200U;
}

Peer::Peer(const std::string& engine, const std::vector<std::string>& args) {
  std::vector<std::string> all = {FASTCYCLE_DDS_PEER, engine, std::to_string(domain_of_test()),
                                  "lo"};
  all.insert(all.end(), args.begin(), args.end());
  std::vector<char*> pointers;
  for (std::string& arg : all) {
    pointers.push_back(arg.data());
  }
  pointers.push_back(nullptr);

  std::array<int, 2> input{};
  std::array<int, 2> output{};
  if (pipe2(input.data(), O_CLOEXEC) != 0 || pipe2(output.data(), O_CLOEXEC) != 0) {
    throw std::runtime_error("no pipe");
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input[0], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output[1], STDOUT_FILENO);
  const int code =
      posix_spawn(&process_, FASTCYCLE_DDS_PEER, &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(input[0]);
  close(output[1]);
  input_ = input[1];
  output_ = output[0];
  char byte = 0;
  bool is_ready = false;
  while (!is_ready && code == 0 && read(output_, &byte, 1) == 1) {
    is_ready = byte == '\n';
  }
  if (!is_ready) {
    close(input_);
    close(output_);
    throw std::runtime_error("the peer did not start");
  }
}

Peer::~Peer() {
  (void)end();
}

bool Peer::has_printed(const std::string& text) {
  pollfd waiting{.fd = output_, .events = POLLIN, .revents = 0};
  char byte = 0;
  while (poll(&waiting, 1, 0) == 1 && read(output_, &byte, 1) == 1) {
    printed_ += byte;
  }
  return printed_.find(text) != std::string::npos;
}

std::string Peer::end() {
  if (process_ <= 0) {
    return printed_;
  }
  close(input_);
  char byte = 0;
  while (read(output_, &byte, 1) == 1) {
    printed_ += byte;
  }
  close(output_);
  int status = 0;
  waitpid(std::exchange(process_, 0), &status, 0);
  EXPECT_EQ(status, 0) << "the peer failed";
  return printed_;
}

}  // namespace fastcycle::dds_gateway
