#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include <sys/types.h>

#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// One client's connection: partially received requests, and output that waits to be written.
///
/// @threads  Confined.
class Connection {
 public:
  /// Upper limit of queued output for a client that does not read.
  static constexpr std::size_t kMaxWaiting = std::size_t{32} << 20U;
  /// Above this limit, no further requests are read and no stream data is queued.
  static constexpr std::size_t kEnoughWaiting = std::size_t{1} << 20U;
  /// Above this limit, a connection within this process gets no messages: it may request all topics
  /// at once, and one large message must not displace those of the others.
  static constexpr std::size_t kEnoughWithin = std::size_t{16} << 20U;

  /// Takes over `descriptor`, which is non-blocking.
  Connection(int descriptor, std::uint64_t its_number, uid_t its_uid, pid_t its_pid)
      : number(its_number), uid(its_uid), pid(its_pid), descriptor_(descriptor) {}
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  /// Reads a bounded amount of input; false if the client has disconnected.
  [[nodiscard]] bool receive();
  /// Whether `next` would return a frame or an error.
  [[nodiscard]] bool has_next(std::size_t max_frame) const;
  /// The next complete frame, valid until the next call; null if there is none. If the input
  /// exceeds the maximum frame size, `wrong` reports it.
  [[nodiscard]] std::optional<std::string_view> next(std::size_t max_frame, std::string& wrong);
  /// Queues one frame.
  void put(const protocol::Answer& answer);
  /// Writes as much as possible; false if the client has disconnected.
  [[nodiscard]] bool write(std::int64_t now_ns);

  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_; }
  /// Received bytes of requests that are not answered yet.
  [[nodiscard]] std::size_t received() const noexcept { return in_.size() - taken_; }
  /// Since when output has been pending without a successful write; 0 if none is pending.
  [[nodiscard]] std::int64_t stuck_since_ns() const noexcept { return stuck_since_ns_; }
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }

  const std::uint64_t number;
  const uid_t uid;
  const pid_t pid;
  std::int64_t came_ns = 0;
  bool is_greeted = false;
  bool is_within = false;  ///< The client is of this process.
  std::string client;      ///< As the client identifies itself.

 private:
  const int descriptor_;
  std::string in_;
  std::size_t taken_ = 0;  ///< Consumed bytes of `in_`.
  std::deque<std::string> out_;
  std::size_t written_ = 0;  ///< Of the first frame.
  std::size_t waiting_ = 0;
  std::int64_t stuck_since_ns_ = 0;
};

}  // namespace fastcycle::inspect
