#pragma once

#include <string>
#include <vector>

#include <sys/types.h>

namespace fastcycle::dds_gateway {

/// Puts this process into a network of its own, with loopback alone, where the system allows it: no
/// packet of a test leaves it. Called before there are threads.
void enter_own_network();

/// A number of a domain that no other test of this machine uses now, where they share a network.
[[nodiscard]] unsigned domain_of_test();

/// Another process in the network; ends with this object.
class Peer {
 public:
  /// `args` are those of peer.cc behind the interface; returns once it is ready.
  Peer(const std::string& engine, const std::vector<std::string>& args);
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer();

  /// Whether it has said `text` since it was ready. Does not wait.
  [[nodiscard]] bool has_said(const std::string& text);
  /// Has it end, and returns what it has said since it was ready.
  std::string end();

 private:
  pid_t process_ = 0;
  int input_ = -1;
  int output_ = -1;
  std::string said_;
};

}  // namespace fastcycle::dds_gateway
