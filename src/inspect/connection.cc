#include "inspect/connection.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include "inspect/frame.h"

namespace fastcycle::inspect {

Connection::~Connection() {
  ::close(descriptor_);
}

bool Connection::receive() {
  constexpr std::size_t kPiece = std::size_t{64} << 10U;
  in_.erase(0, std::exchange(taken_, 0));
  if (in_.empty() && in_.capacity() > 4 * kPiece) {
    in_.shrink_to_fit();  // After a large frame.
  }
  const std::size_t before = in_.size();
  in_.resize(before + kPiece);
  const ssize_t count = ::recv(descriptor_, in_.data() + before, kPiece, MSG_DONTWAIT);
  const int error = errno;
  in_.resize(before + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  return count > 0 || (count < 0 && (error == EAGAIN || error == EINTR));
}

bool Connection::has_next(std::size_t max_frame) const {
  const std::string_view rest = std::string_view(in_).substr(taken_);
  if (rest.size() < kFrameHead) {
    return false;
  }
  const std::size_t size = read_size(rest);
  return size > max_frame || rest.size() >= kFrameHead + size;
}

std::optional<std::string_view> Connection::next(std::size_t max_frame, std::string& wrong) {
  if (!has_next(max_frame)) {
    return std::nullopt;
  }
  const std::string_view rest = std::string_view(in_).substr(taken_);
  const std::size_t size = read_size(rest);
  if (size > max_frame) {
    wrong =
        fmt::format("a frame of {} bytes is too large: at most {} may be sent", size, max_frame);
    return std::nullopt;
  }
  taken_ += kFrameHead + size;
  return rest.substr(kFrameHead, size);
}

void Connection::put(const protocol::Answer& answer) {
  const std::size_t size = answer.ByteSizeLong();
  std::string frame;
  frame.reserve(kFrameHead + size);
  append_size(frame, size);
  answer.AppendToString(&frame);
  waiting_ += frame.size();
  out_.push_back(std::move(frame));
}

bool Connection::write(std::int64_t now_ns) {
  while (!out_.empty()) {
    const std::string& first = out_.front();
    const ssize_t count = ::send(descriptor_, first.data() + written_, first.size() - written_,
                                 MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0 && errno == EAGAIN) {
      stuck_since_ns_ = stuck_since_ns_ == 0 ? now_ns : stuck_since_ns_;
      return true;
    }
    if (count < 0) {
      return false;
    }
    stuck_since_ns_ = 0;
    written_ += static_cast<std::size_t>(count);
    waiting_ -= static_cast<std::size_t>(count);
    if (written_ == first.size()) {
      out_.pop_front();
      written_ = 0;
    }
  }
  return true;
}

}  // namespace fastcycle::inspect
