#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "peers/common/run.h"

namespace fastcycle::peers {

/// Which way a message takes to the code that uses it. Numbers of different classes are not
/// compared.
enum class Delivery : std::uint8_t { kBetweenThreads, kPublishersThread, kBetweenProcesses };

/// One way to use a peer.
struct Variant {
  std::string name;
  std::string about;  ///< One sentence.
  Delivery delivery;
  bool is_typed;       ///< The receiver gets an object of the message's type, checked by the peer.
  std::string copies;  ///< Of the payload, on the way from publish call to callback.
  void (*measure)(Run& run);
  /// Time for which one MiB keeps publisher and subscriber busy, if it matters for the interval.
  double busy_us_per_mib = 0;
  std::string daemon = {};  ///< The daemon that it needs: "rosmaster", "roudi", or nothing.
};

/// A peer and all its variants. The first one is the default.
struct Peer {
  std::string name;
  std::string version;  ///< Of the middleware.
  std::vector<Variant> variants;
};

/// main() of every peer: reads the command line, measures, prints one line of JSON.
int peer_main(int argc, char** argv, const Peer& peer);

}  // namespace fastcycle::peers
