#include "bus.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace ads {
namespace {

// The number of frames read in a row, before the thread checks whether it has to end.
constexpr int kBurst = 64;

struct ErrorBit {
  std::uint32_t bit;
  std::string_view text;
};
constexpr std::array<ErrorBit, 8> kErrorClasses = {{{CAN_ERR_TX_TIMEOUT, "time-out of sending"},
                                                    {CAN_ERR_LOSTARB, "lost arbitration"},
                                                    {CAN_ERR_PROT, "violation of the protocol"},
                                                    {CAN_ERR_TRX, "error of the transceiver"},
                                                    {CAN_ERR_ACK, "no acknowledgement"},
                                                    {CAN_ERR_BUSOFF, "bus-off"},
                                                    {CAN_ERR_BUSERROR, "bus error"},
                                                    {CAN_ERR_RESTARTED, "restarted"}}};
constexpr std::array<ErrorBit, 7> kControllerStates = {
    {{CAN_ERR_CRTL_RX_OVERFLOW, "overflow of receiving"},
     {CAN_ERR_CRTL_TX_OVERFLOW, "overflow of sending"},
     {CAN_ERR_CRTL_RX_WARNING, "many errors of receiving"},
     {CAN_ERR_CRTL_TX_WARNING, "many errors of sending"},
     {CAN_ERR_CRTL_RX_PASSIVE, "error passive by receiving"},
     {CAN_ERR_CRTL_TX_PASSIVE, "error passive by sending"},
     {CAN_ERR_CRTL_ACTIVE, "error active again"}}};

template <std::size_t size>
void add_texts(const std::array<ErrorBit, size>& bits, std::uint32_t value, std::string& text) {
  for (const ErrorBit& its : bits) {
    if ((value & its.bit) != 0) {
      text += text.empty() ? "" : ", ";
      text += its.text;
    }
  }
}

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& text = path.native();
  if (text.size() >= sizeof address.sun_path) {
    errno = ENAMETOOLONG;
    throw_errno(text);
  }
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  return address;
}

}  // namespace

CanError can_error_of(const can_frame& frame) {
  CanError error{.is_bus_off = (frame.can_id & CAN_ERR_BUSOFF) != 0,
                 .is_restart = (frame.can_id & CAN_ERR_RESTARTED) != 0,
                 .text = {}};
  add_texts(kErrorClasses, frame.can_id, error.text);
  if ((frame.can_id & CAN_ERR_CRTL) != 0) {
    add_texts(kControllerStates, frame.data[1], error.text);
  }
  if (error.text.empty()) {
    error.text = fmt::format("error frame {:08x}", frame.can_id);
  }
  return error;
}

int CanBus::open() {
  Descriptor socket = open_socket();
  const std::lock_guard lock(mutex_);
  socket_ = std::move(socket);
  return socket_.get();
}

void CanBus::close() noexcept {
  const std::lock_guard lock(mutex_);
  socket_.reset();
}

bool CanBus::read() {
  bool is_usable = false;
  for (int count = 0; count < kBurst; ++count) {
    can_frame frame{};
    const auto size = ::recv(socket_.get(), &frame, sizeof frame, MSG_DONTWAIT);
    if (size < 0) {
      if (errno == EAGAIN || errno == EINTR) {
        break;
      }
      throw_errno(name());
    }
    if (size == static_cast<ssize_t>(sizeof frame) && frame.can_dlc <= CAN_MAX_DLEN) {
      is_usable = sink_(frame) || is_usable;
    }
  }
  return is_usable;
}

std::string CanBus::send(const can_frame& frame) {
  const std::lock_guard lock(mutex_);
  if (!socket_.is_open()) {
    return name() + " is not open";
  }
  if (send_on(socket_.get(), frame)) {
    return {};
  }
  const bool is_full = errno == ENOBUFS || errno == EAGAIN;
  return fmt::format("{}: {}", name(),
                     is_full ? "the queue of what is to be sent is full: nobody acknowledges"
                             : std::generic_category().message(errno));
}

Descriptor SocketCanBus::open_socket() {
  Descriptor socket = checked_descriptor(
      ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW), name());
  ifreq request{};
  if (interface_.size() >= sizeof request.ifr_name) {
    errno = ENODEV;
    throw_errno(name());
  }
  std::memcpy(request.ifr_name, interface_.c_str(), interface_.size() + 1);
  if (::ioctl(socket.get(), SIOCGIFINDEX, &request) < 0) {
    throw_errno(name());
  }
  const can_err_mask_t all_errors = CAN_ERR_MASK;
  if (::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors) <
      0) {
    throw_errno(name());
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0) {
    throw_errno(name());
  }
  return socket;
}

bool SocketCanBus::send_on(int socket, const can_frame& frame) const {
  return ::send(socket, &frame, sizeof frame, MSG_DONTWAIT) == static_cast<ssize_t>(sizeof frame);
}

FakeCanBus::~FakeCanBus() {
  close();
  ::unlink(own_.c_str());
}

std::filesystem::path FakeCanBus::ads_end(const std::filesystem::path& bus) {
  return bus.string() + ".ads";
}

std::filesystem::path FakeCanBus::vehicle_end(const std::filesystem::path& bus) {
  return bus.string() + ".vehicle";
}

Descriptor FakeCanBus::open_socket() {
  Descriptor socket =
      checked_descriptor(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), name());
  const sockaddr_un address = address_of(own_);
  ::unlink(own_.c_str());  // Left by an earlier run.
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0) {
    throw_errno(name());
  }
  return socket;
}

bool FakeCanBus::send_on(int socket, const can_frame& frame) const {
  const sockaddr_un address = address_of(other_);
  return ::sendto(socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_NOSIGNAL,
                  reinterpret_cast<const sockaddr*>(&address),
                  sizeof address) == static_cast<ssize_t>(sizeof frame);
}

}  // namespace ads
