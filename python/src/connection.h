#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "inspect/client.h"

namespace fastcycle::python {

/// A connection to a running application over which serialized requests and answers go.
///
/// @threads  Safe.
/// @errors   `inspect::ClientError`.
class Connection {
 public:
  Connection(const std::string& socket, const std::string& who) : client_(socket, who) {}

  /// The application's `Welcome`, serialized.
  [[nodiscard]] std::string welcome();
  /// Sends a `Request`, without its id; returns the id. @errors  `std::invalid_argument` if it is
  /// none.
  std::uint32_t post(const std::string& request);
  /// The next `Answer`; none if there is none within `patience`.
  std::optional<std::string> take(std::chrono::milliseconds patience);

 private:
  std::mutex mutex_;
  inspect::Client client_;
};

/// The `FileDescriptorSet` of what `Connection` sends and gets.
[[nodiscard]] std::string protocol_schema();

}  // namespace fastcycle::python
