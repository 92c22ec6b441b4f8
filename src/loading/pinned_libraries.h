#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "config/description.h"
#include "config/problem.h"

namespace fastcycle::host {

/// A dependency of a component library, in a folder which that one names.
struct NeededLibrary {
  std::string name;            ///< Of its file: "libfastcycle_ads_messages.so.0.1".
  std::filesystem::path file;  ///< Its path.
};

/// Dependencies of a library in the folders it names, system libraries thus excluded; dependencies
/// come first.
[[nodiscard]] std::vector<NeededLibrary> needed_libraries(const std::filesystem::path& library);

/// SHA-256 of a file, in 64 hexadecimal digits; empty, with `errno`, if it cannot be read.
[[nodiscard]] std::string sha256_of(const std::filesystem::path& file);

/// Whether the process has loaded a library of this name, as its users list it.
[[nodiscard]] bool is_library_loaded(const std::string& name);

/// Seals a file in memory: nothing can write to it from then on. As long as the kernel holds one of
/// its pages, for example while it looks for memory to reclaim, it answers EBUSY after 150 ms; this
/// waits for up to some seconds. False, with `errno`: it is not sealed.
[[nodiscard]] bool seal(int file);

/// A copy of a file in sealed memory. Its descriptor stays open as long as it is loaded, so that
/// its path is not reused for another library.
struct SealedCopy {
  int file = -1;       ///< A descriptor; -1, with `errno`: there is no copy.
  std::string sha256;  ///< In 64 hexadecimal digits.
};
[[nodiscard]] SealedCopy seal_copy(const std::string& name, const std::filesystem::path& file);
/// The path by which this process opens it.
[[nodiscard]] std::string path_of(const SealedCopy& copy);

/// Opens libraries whose contents an application pins: each is copied to sealed memory, verified
/// there, and loaded from there. The code that runs is the code that was verified.
///
/// @threads  Confined to the control thread.
class PinnedLibraries {
 public:
  explicit PinnedLibraries(config::LibrariesDescription pins) : pins_(std::move(pins)) {}

  /// As `dlopen`, including dependencies that the process has not loaded. Null after adding to
  /// `problems`.
  [[nodiscard]] void* open(const std::string& name, const std::filesystem::path& file,
                           config::Problems& problems) const;

 private:
  [[nodiscard]] void* open_one(const std::string& name, const std::filesystem::path& file,
                               config::Problems& problems) const;

  config::LibrariesDescription pins_;
};

}  // namespace fastcycle::host
