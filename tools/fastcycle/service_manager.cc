#include "service_manager.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <string_view>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace fastcycle::tool {
namespace {

void send_to_manager(std::string_view state) noexcept {
  const char* const place = std::getenv("NOTIFY_SOCKET");
  const std::string_view path = place == nullptr ? "" : place;
  sockaddr_un address{};
  if (path.size() < 2 || path.size() >= sizeof(address.sun_path)) {
    return;
  }
  address.sun_family = AF_UNIX;
  std::ranges::copy(path, address.sun_path);
  if (path.front() == '@') {
    address.sun_path[0] = '\0';  // A name of the abstract namespace.
  }
  const int file = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (file < 0) {
    return;
  }
  static_cast<void>(sendto(file, state.data(), state.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                           reinterpret_cast<const sockaddr*>(&address),
                           static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size())));
  close(file);
}

}  // namespace

void report_started() noexcept {
  send_to_manager("READY=1");
}

void report_stopping() noexcept {
  send_to_manager("STOPPING=1");
}

}  // namespace fastcycle::tool
