#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::dds_security {

/// The files that a participant needs, in one folder: those of an enclave of ROS 2.
struct Enclave {
  std::filesystem::path identity_ca;     ///< The certificate of the authority for identities.
  std::filesystem::path certificate;     ///< The participant's own.
  std::filesystem::path key;             ///< The private key of that.
  std::filesystem::path permissions_ca;  ///< The certificate that verifies the two documents.
  std::filesystem::path governance;
  std::filesystem::path permissions;
};

/// Their absolute paths.
[[nodiscard]] Enclave enclave_in(const std::filesystem::path& folder);

/// All errors of an enclave that can be found without DDS, each with the file, what was expected
/// and what was found: missing or unreadable files, a key of another certificate, a certificate or
/// a document that is not signed by the authority, or that has expired. Empty if there are none.
[[nodiscard]] std::vector<std::string> enclave_errors(const std::filesystem::path& folder);

/// Whether others than its owner can read its private key.
[[nodiscard]] bool has_open_key(const std::filesystem::path& folder);

/// The name in its certificate: `/gateway`; empty if it cannot be read.
[[nodiscard]] std::string name_of_enclave(const std::filesystem::path& folder);

}  // namespace fastcycle::dds_security
