#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::web {

/// A certificate and its private key, both in PEM.
struct Certificate {
  std::string chain;  ///< The certificate, and its issuers.
  std::string key;
};

/// Creates a self-signed certificate for `names`: IP addresses and host names. Valid for 90 days,
/// elliptic curve P-256.
///
/// @errors  `std::runtime_error` on failure.
[[nodiscard]] Certificate make_certificate(const std::vector<std::string>& names);

/// The SHA-256 of the first certificate in `chain`, as browsers show it: "3A:0F:…".
///
/// @errors  `std::runtime_error` if there is none.
[[nodiscard]] std::string fingerprint_of(std::string_view chain);

}  // namespace fastcycle::web
