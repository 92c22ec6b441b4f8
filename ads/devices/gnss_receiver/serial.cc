#include "serial.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

namespace ads {
namespace {

struct Baud {
  int baud;
  speed_t speed;
};
constexpr std::array<Baud, 9> kBauds = {{{4800, B4800},
                                         {9600, B9600},
                                         {19200, B19200},
                                         {38400, B38400},
                                         {57600, B57600},
                                         {115200, B115200},
                                         {230400, B230400},
                                         {460800, B460800},
                                         {921600, B921600}}};

}  // namespace

bool is_baud(int baud) {
  return std::ranges::any_of(kBauds, [baud](const Baud& its) { return its.baud == baud; });
}

int SerialDevice::open() {
  line_ = checked_descriptor(
      ::open(config_.path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC), name());
  termios settings{};
  if (::tcgetattr(line_.get(), &settings) < 0) {
    throw_errno(name());
  }
  ::cfmakeraw(&settings);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | PARENB | PARODD | CRTSCTS);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag |= config_.stop_bits == 2 ? CSTOPB : 0;
  settings.c_cflag |= config_.parity == Parity::kNone ? 0 : PARENB;
  settings.c_cflag |= config_.parity == Parity::kOdd ? PARODD : 0;
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  const auto* const its =
      std::ranges::find_if(kBauds, [this](const Baud& at) { return at.baud == config_.baud; });
  if (its != kBauds.end()) {
    (void)::cfsetispeed(&settings, its->speed);
    (void)::cfsetospeed(&settings, its->speed);
  }
  if (::tcsetattr(line_.get(), TCSANOW, &settings) < 0) {
    throw_errno(name());
  }
  return line_.get();
}

bool SerialDevice::read() {
  std::array<char, 4096> bytes;
  const auto size = ::read(line_.get(), bytes.data(), bytes.size());
  if (size < 0) {
    if (errno == EAGAIN || errno == EINTR) {
      return false;
    }
    throw_errno(name());
  }
  if (size == 0) {
    throw std::system_error(EIO, std::generic_category(), name());  // It was hung up.
  }
  return sink_({bytes.data(), static_cast<std::size_t>(size)});
}

}  // namespace ads
