#pragma once

#include <filesystem>

#include <sys/un.h>

namespace fastcycle::inspect {

/// @errors  `std::runtime_error` if the file's name is too long for a socket.
[[nodiscard]] sockaddr_un address_of(const std::filesystem::path& file);

}  // namespace fastcycle::inspect
