#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace fastcycle::inspect {

/// Folder of the sockets of this user's applications: `$XDG_RUNTIME_DIR/fastcycle`, else
/// `fastcycle-UID` in the temporary folder.
[[nodiscard]] std::filesystem::path socket_folder();

/// Why `folder` must not be used: this user does not own it, or others have access. Empty if it is
/// usable or does not exist.
[[nodiscard]] std::string find_wrong(const std::filesystem::path& folder);

/// A listening socket.
struct FoundSocket {
  std::string name;  ///< The application's.
  std::filesystem::path file;
  pid_t pid = 0;  ///< Of the listening process.
};

/// The sockets that have a listener, by name. Excludes what a crashed run left behind.
[[nodiscard]] std::vector<FoundSocket> find_sockets(const std::filesystem::path& folder);

/// A listening Unix socket as a file that only this user may open; the destructor removes it.
///
/// @threads  Confined.
class SocketFile {
 public:
  /// Listens as `NAME.sock` in `folder`, which is created with mode 0700; replaces the socket of a
  /// crashed run. If another application of that name runs, the name becomes `NAME-2`, and so on.
  ///
  /// @errors  `std::runtime_error`: this user does not own the folder, or others have access.
  SocketFile(const std::filesystem::path& folder, std::string_view application);
  SocketFile(const SocketFile&) = delete;
  SocketFile& operator=(const SocketFile&) = delete;
  ~SocketFile();

  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  /// The application's name, with a number if another application has the same name.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  int descriptor_ = -1;
  int lock_ = -1;  ///< Held as long as this owns the name.
  std::filesystem::path file_;
  std::string name_;
};

}  // namespace fastcycle::inspect
