#pragma once

#include <string>
#include <vector>

#include <sys/types.h>

namespace fastcycle::dds_gateway {

/// Moves this process into its own network namespace, with only loopback, if the system allows it:
/// no packet of a test leaves it. Call before there are threads.
void enter_own_network();

/// A domain number unused by other tests of this machine, if they share a network.
[[nodiscard]] unsigned domain_of_test();

/// Another process in the network; ends with this object.
class Peer {
 public:
  /// `args` are those of peer.cc after the interface; returns once it is ready.
  Peer(const std::string& engine, const std::vector<std::string>& args);
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer();

  /// Whether it has printed `text` since it was ready. Does not wait.
  [[nodiscard]] bool has_printed(const std::string& text);
  /// Ends it, and returns its output since it was ready.
  std::string end();

 private:
  pid_t process_ = 0;
  int input_ = -1;
  int output_ = -1;
  std::string printed_;
};

}  // namespace fastcycle::dds_gateway
