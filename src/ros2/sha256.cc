#include "ros2/sha256.h"

#include <new>

#include <openssl/evp.h>

namespace fastcycle::ros2 {

std::array<std::byte, 32> sha256(std::string_view text) {
  std::array<std::byte, 32> digest{};
  if (::EVP_Digest(text.data(), text.size(), reinterpret_cast<unsigned char*>(digest.data()),
                   nullptr, ::EVP_sha256(), nullptr) != 1) {
    throw std::bad_alloc();  // The only reason to fail.
  }
  return digest;
}

}  // namespace fastcycle::ros2
