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

/// One client's connection: what came of a request that is not whole yet, and what waits for it to
/// read.
///
/// @threads  Confined.
class Connection {
 public:
  /// More than this does not wait for a client that does not read.
  static constexpr std::size_t kMaxWaiting = std::size_t{32} << 20U;
  /// With more than this, no more is asked for: neither requests are read, nor streams written.
  static constexpr std::size_t kEnoughWaiting = std::size_t{1} << 20U;
  /// With more than this, a connection within this process gets no messages: it may ask for all
  /// topics at once, and one large message must not cost it those of the others.
  static constexpr std::size_t kEnoughWithin = std::size_t{16} << 20U;

  /// Takes over `descriptor`, which does not block.
  Connection(int descriptor, std::uint64_t its_number, uid_t its_uid, pid_t its_pid)
      : number(its_number), uid(its_uid), pid(its_pid), descriptor_(descriptor) {}
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  /// Reads what came, a bounded piece of it; false if the client is gone.
  [[nodiscard]] bool receive();
  /// Whether `next` has something to say.
  [[nodiscard]] bool has_next(std::size_t max_frame) const;
  /// The next whole frame, good until anything else is called; null if there is none. If what came
  /// is larger than a frame may be, that is told in `wrong`.
  [[nodiscard]] std::optional<std::string_view> next(std::size_t max_frame, std::string& wrong);
  /// Queues one frame.
  void put(const protocol::Answer& answer);
  /// Writes what it can; false if the client is gone.
  [[nodiscard]] bool write(std::int64_t now_ns);

  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_; }
  /// What came of requests that are not answered yet, in bytes.
  [[nodiscard]] std::size_t received() const noexcept { return in_.size() - taken_; }
  /// Since when nothing could be written, though something waits; 0 if nothing does.
  [[nodiscard]] std::int64_t stuck_since_ns() const noexcept { return stuck_since_ns_; }
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }

  const std::uint64_t number;
  const uid_t uid;
  const pid_t pid;
  std::int64_t came_ns = 0;
  bool is_greeted = false;
  bool is_within = false;  ///< The client is of this process.
  std::string client;      ///< Who it says that it is.

 private:
  const int descriptor_;
  std::string in_;
  std::size_t taken_ = 0;  ///< Of what came.
  std::deque<std::string> out_;
  std::size_t written_ = 0;  ///< Of the first.
  std::size_t waiting_ = 0;
  std::int64_t stuck_since_ns_ = 0;
};

}  // namespace fastcycle::inspect
