#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::dds_security {

/// The files that a participant needs, in one folder: those of an enclave of ROS 2.
struct Enclave {
  std::filesystem::path identity_ca;     ///< The certificate that vouches for identities.
  std::filesystem::path certificate;     ///< The participant's own.
  std::filesystem::path key;             ///< The private key of that.
  std::filesystem::path permissions_ca;  ///< The certificate that the two documents are signed by.
  std::filesystem::path governance;
  std::filesystem::path permissions;
};

/// Where they are; absolute.
[[nodiscard]] Enclave enclave_in(const std::filesystem::path& folder);

/// All that is wrong with an enclave and can be known without DDS, each with the file, what was
/// expected and what was found: files that are not there or cannot be read, a key that is another
/// one's, a certificate or a document that nobody vouches for, or whose time is over. Empty if
/// nothing is.
[[nodiscard]] std::vector<std::string> mistakes_of_enclave(const std::filesystem::path& folder);

/// Whether others than its owner can read its private key.
[[nodiscard]] bool has_open_key(const std::filesystem::path& folder);

/// The name in its certificate: `/gateway`; empty if it cannot be read.
[[nodiscard]] std::string name_of_enclave(const std::filesystem::path& folder);

}  // namespace fastcycle::dds_security
