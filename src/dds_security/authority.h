#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace fastcycle::dds_security {

/// A certificate and its private key, both in PEM.
struct Identity {
  std::string certificate;
  std::string key;
};

using Days = std::chrono::days;

/// A certificate authority, which vouches for itself. Elliptic curve P-256, as all keys here.
///
/// @errors  `std::runtime_error` if OpenSSL refuses; so do all functions here.
[[nodiscard]] Identity make_authority(const std::string& name, Days valid);

/// A certificate for `name` that `authority` vouches for, no longer than its own is valid.
[[nodiscard]] Identity issue(const Identity& authority, const std::string& name, Days valid);

/// `document` with the signature of `authority`: S/MIME, in which the document can be read.
[[nodiscard]] std::string sign(const Identity& authority, std::string_view document);

/// When a certificate ends.
[[nodiscard]] std::chrono::sys_seconds end_of(std::string_view certificate);

}  // namespace fastcycle::dds_security
