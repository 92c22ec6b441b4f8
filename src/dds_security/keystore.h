#pragma once

#include <filesystem>
#include <string>

#include "dds_security/authority.h"
#include "dds_security/documents.h"

namespace fastcycle::dds_security {

/// Creates a keystore: a certificate authority and the rules of its domains, in the layout of ROS
/// 2. Creates all of it or nothing; existing files are never changed.
///
///     DIR/public the certificate of the authority DIR/private its key, readable by its owner only;
///     stays where enclaves are created DIR/enclaves governance.xml, governance.p7s, and each
///     enclave
///
/// @errors  `std::runtime_error`, with the path; so do all functions here.
void make_keystore(const std::filesystem::path& folder, Days valid);

/// Adds the enclave `name`, which is a name of ROS 2 and begins with a slash. Returns its folder.
std::filesystem::path add_enclave(const std::filesystem::path& keystore, const std::string& name,
                                  const Rights& rights, Days valid);

}  // namespace fastcycle::dds_security
