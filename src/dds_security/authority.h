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

/// A self-signed certificate authority. Elliptic curve P-256, as all keys here.
///
/// @errors  `std::runtime_error` if OpenSSL fails; so do all functions here.
[[nodiscard]] Identity make_authority(const std::string& name, Days valid);

/// A certificate for `name` signed by `authority`, valid no longer than that of `authority`.
[[nodiscard]] Identity issue(const Identity& authority, const std::string& name, Days valid);

/// `document` with the signature of `authority`: S/MIME with the document in clear text.
[[nodiscard]] std::string sign(const Identity& authority, std::string_view document);

/// When a certificate expires.
[[nodiscard]] std::chrono::sys_seconds end_of(std::string_view certificate);

}  // namespace fastcycle::dds_security
