#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace fastcycle::inspect {

/// Where sockets of this user's applications are: `$XDG_RUNTIME_DIR/fastcycle`, else
/// `fastcycle-UID` in the temporary folder.
[[nodiscard]] std::filesystem::path socket_folder();

/// Why `folder` must not be used: it is not this user's own, or others may enter. Empty if it is as
/// it should be, or does not exist.
[[nodiscard]] std::string find_wrong(const std::filesystem::path& folder);

/// One that listens.
struct FoundSocket {
  std::string name;  ///< The application's.
  std::filesystem::path file;
  pid_t pid = 0;  ///< Of who listens.
};

/// Those that somebody listens on, by name. What is left of a crashed run is not among them.
[[nodiscard]] std::vector<FoundSocket> find_sockets(const std::filesystem::path& folder);

/// A Unix socket that listens, as a file that only this user may open, and that is removed with
/// this.
///
/// @threads  Confined.
class SocketFile {
 public:
  /// Listens as `NAME.sock` in `folder`, which is made with mode 0700; what a crashed run left is
  /// replaced. If another application of that name runs, this one is `NAME-2`, and so on.
  ///
  /// @errors  `std::runtime_error`: the folder is not this user's own, or others may enter it.
  SocketFile(const std::filesystem::path& folder, std::string_view application);
  SocketFile(const SocketFile&) = delete;
  SocketFile& operator=(const SocketFile&) = delete;
  ~SocketFile();

  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  /// The application's name, with a number if another one has it too.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  int descriptor_ = -1;
  int lock_ = -1;  ///< Held while the name is this one's.
  std::filesystem::path file_;
  std::string name_;
};

}  // namespace fastcycle::inspect
