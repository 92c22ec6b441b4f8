#include "dds_security/keystore.h"

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/files.h"

namespace fastcycle::dds_security {
namespace {

namespace fs = std::filesystem;

constexpr ::mode_t kForAll = 0644;
constexpr ::mode_t kForOwner = 0600;

constexpr std::string_view kReadme =
    R"(This is a keystore for secure DDS, laid out as ROS 2 lays it out.

public/     the certificate of the authority that vouches for participants and their permissions
private/    its key. Who has it can make participants: keep it where enclaves are made, and nowhere else
enclaves/   governance.xml: the rules of all domains; and a folder for each participant (its "enclave")

An enclave has all that one participant needs. Copy that folder, and nothing else, to the machine that
it runs on, and see that only the user that runs it can read key.pem.

  fastcycle security add . NAME app.json        adds an enclave for the gateway of an application
  {"security": "enclaves/NAME"}                 in the params of that gateway
  ROS_SECURITY_KEYSTORE=. ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce
                                                for nodes of ROS 2, with --ros-args --enclave /NAME

The .p7s files are the .xml files with the signature of the authority: a change of an .xml does nothing.
)";

[[noreturn]] void fail(const fs::path& path, int error) {
  throw std::runtime_error(fmt::format("{}: cannot be written: {}", path.string(),
                                       std::system_category().message(error)));
}

/// A folder that is made beside its place, and gets its name when it is complete.
class NewFolder {
 public:
  explicit NewFolder(fs::path place) : place_(std::move(place)) {
    std::error_code error;
    if (fs::exists(fs::symlink_status(place_, error))) {
      throw std::runtime_error(
          fmt::format("{}: it is there already, and stays as it is", place_.string()));
    }
    std::string name = place_.string() + ".unfinished-XXXXXX";
    if (::mkdtemp(name.data()) == nullptr) {
      fail(place_, errno);
    }
    unfinished_ = name;
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    if (!unfinished_.empty()) {
      std::error_code ignored;
      fs::remove_all(unfinished_, ignored);
    }
  }

  void add_folder(const fs::path& name, ::mode_t mode) const {
    if (::mkdir((unfinished_ / name).c_str(), mode) != 0) {
      fail(place_ / name, errno);
    }
  }
  void add_link(const fs::path& name, const char* to) const {
    if (::symlink(to, (unfinished_ / name).c_str()) != 0) {
      fail(place_ / name, errno);
    }
  }
  void add(const fs::path& name, std::string_view text, ::mode_t mode) const {
    const int file = ::open((unfinished_ / name).c_str(),
                            O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
    if (file < 0) {
      fail(place_ / name, errno);
    }
    bool is_written = true;
    while (is_written && !text.empty()) {
      const ssize_t count = ::write(file, text.data(), text.size());
      is_written = count > 0;
      text.remove_prefix(is_written ? static_cast<std::size_t>(count) : 0);
    }
    is_written = is_written && ::fsync(file) == 0;
    const int error = errno;
    ::close(file);
    if (!is_written) {
      fail(place_ / name, error);
    }
  }
  void finish() {
    (void)::chmod(unfinished_.c_str(), 0755);
    if (const int error = base::rename_to_free(unfinished_, place_); error != 0) {
      fail(place_, error);
    }
    unfinished_.clear();
    base::sync_folder(place_.parent_path());
  }

 private:
  const fs::path place_;
  fs::path unfinished_;
};

std::string read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file.is_open() || text.empty()) {
    throw std::runtime_error(
        fmt::format("{}: expected a file of a keystore, as `fastcycle security init` makes it, "
                    "found none that can be read",
                    path.string()));
  }
  return text;
}

/// Without a slash at its end, whose parent would be itself.
fs::path plain(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

}  // namespace

void make_keystore(const fs::path& folder, Days valid) {
  NewFolder keystore(plain(folder));
  const Identity authority = make_authority("FastCycle DDS authority", valid);
  keystore.add("README", kReadme, kForAll);
  keystore.add_folder("public", 0755);
  keystore.add("public/ca.cert.pem", authority.certificate, kForAll);
  keystore.add_folder("private", 0700);
  keystore.add("private/ca.key.pem", authority.key, kForOwner);
  for (const std::string kind : {"identity_ca", "permissions_ca"}) {
    keystore.add_link("public/" + kind + ".cert.pem", "ca.cert.pem");
    keystore.add_link("private/" + kind + ".key.pem", "ca.key.pem");
  }
  keystore.add_folder("enclaves", 0755);
  const std::string rules = governance();
  keystore.add("enclaves/governance.xml", rules, kForAll);
  keystore.add("enclaves/governance.p7s", sign(authority, rules), kForAll);
  keystore.finish();
}

fs::path add_enclave(const fs::path& keystore, const std::string& name, const Rights& rights,
                     Days valid) {
  const Identity identities{.certificate = read(keystore / "public/identity_ca.cert.pem"),
                            .key = read(keystore / "private/identity_ca.key.pem")};
  const Identity documents{.certificate = read(keystore / "public/permissions_ca.cert.pem"),
                           .key = read(keystore / "private/permissions_ca.key.pem")};
  const std::string rules = read(keystore / "enclaves/governance.p7s");
  const fs::path place = plain(keystore / "enclaves" / name.substr(1));
  fs::create_directories(place.parent_path());
  NewFolder enclave(place);
  const Identity own = issue(identities, name, valid);
  const std::string allowed = permissions(name, rights, end_of(own.certificate));
  enclave.add("identity_ca.cert.pem", identities.certificate, kForAll);
  enclave.add("permissions_ca.cert.pem", documents.certificate, kForAll);
  enclave.add("cert.pem", own.certificate, kForAll);
  enclave.add("key.pem", own.key, kForOwner);
  enclave.add("governance.p7s", rules, kForAll);
  enclave.add("permissions.xml", allowed, kForAll);
  enclave.add("permissions.p7s", sign(documents, allowed), kForAll);
  enclave.finish();
  return place;
}

}  // namespace fastcycle::dds_security
