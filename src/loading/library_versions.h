#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "base/priority_mutex.h"
#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/library.h"

namespace fastcycle::host {

/// Opens component libraries while the application runs: each as a private copy of its file, so
/// that a rebuilt file is loaded as new code even if a library of that name is open. Contents that
/// were opened once are not opened again; they stay mapped until the process ends.
///
/// @threads  Safe.
class LibraryVersions {
 public:
  /// With `pins`, opens only these, and only with these contents.
  explicit LibraryVersions(std::optional<config::LibrariesDescription> pins)
      : pins_(std::move(pins)) {}

  struct Opened {
    const ComponentLibrary* library = nullptr;
    std::string sha256;  ///< Of the file.
  };
  /// `name` is the name in messages of the library in `file`. Returns no library after adding to
  /// `problems`, also if `expected` is not empty and the file has other contents.
  [[nodiscard]] Opened open(const std::string& name, const std::filesystem::path& file,
                            const std::string& expected, config::Problems& problems);

 private:
  [[nodiscard]] bool is_pinned(const std::string& name, const std::string& sha256,
                               config::Problems& problems) const;

  const std::optional<config::LibrariesDescription> pins_;
  base::PriorityMutex mutex_;
  std::map<std::string, const ComponentLibrary*> open_;  ///< By SHA-256.
};

}  // namespace fastcycle::host
