#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "config/description.h"
#include "config/problem.h"

namespace fastcycle::host {

/// A library that is loaded with a component library, from a folder which that one names.
struct NeededLibrary {
  std::string name;            ///< Of its file: "libfastcycle_ads_messages.so.0.1".
  std::filesystem::path file;  ///< Where it lies.
};

/// What a library needs, from the folders that it names itself, so none of the system: what others
/// need first.
[[nodiscard]] std::vector<NeededLibrary> needed_libraries(const std::filesystem::path& library);

/// SHA-256 of a file, in 64 hexadecimal digits; empty, with `errno`, if it cannot be read.
[[nodiscard]] std::string sha256_of(const std::filesystem::path& file);

/// Whether the process has loaded a library of this name, as those that need it say it.
[[nodiscard]] bool is_library_loaded(const std::string& name);

/// A copy of a file in memory that cannot be changed any more. Its descriptor stays open as long as
/// it is loaded: its name must not become that of another one.
struct SealedCopy {
  int file = -1;       ///< A descriptor; -1, with `errno`: there is no copy.
  std::string sha256;  ///< In 64 hexadecimal digits.
};
[[nodiscard]] SealedCopy seal_copy(const std::string& name, const std::filesystem::path& file);
/// By which it is opened in this process.
[[nodiscard]] std::string path_of(const SealedCopy& copy);

/// Opens libraries whose contents an application pins: each is copied to memory that nobody can
/// write any more, looked at there, and loaded from there. What was looked at is what runs.
///
/// @threads  Confined to the control thread.
class PinnedLibraries {
 public:
  explicit PinnedLibraries(config::LibrariesDescription pins) : pins_(std::move(pins)) {}

  /// As `dlopen`, with all that it needs and the process has not loaded. Null after adding to
  /// `problems`.
  [[nodiscard]] void* open(const std::string& name, const std::filesystem::path& file,
                           config::Problems& problems) const;

 private:
  [[nodiscard]] void* open_one(const std::string& name, const std::filesystem::path& file,
                               config::Problems& problems) const;

  config::LibrariesDescription pins_;
};

}  // namespace fastcycle::host
