#include "loading/library_versions.h"

#include <cerrno>
#include <cstring>
#include <mutex>

#include <dlfcn.h>
#include <unistd.h>

#include "base/floating_point.h"
#include "loading/component_library.h"
#include "loading/pinned_libraries.h"

namespace fastcycle::host {

bool LibraryVersions::is_pinned(const std::string& name, const std::string& sha256,
                                config::Problems& problems) const {
  if (!pins_) {
    return true;
  }
  const auto pin = pins_->sha256.find(name);
  if (pin != pins_->sha256.end() && pin->second == sha256) {
    return true;
  }
  problems.add(config::make_error(
      pins_->place,
      "library \"" + name + "\" " +
          (pin == pins_->sha256.end() ? "is not among those that may be loaded"
                                      : "has other contents than are pinned: " + sha256),
      "fastcycle check APPLICATION --print-pins prints what \"libraries\" has to say"));
  return false;
}

LibraryVersions::Opened LibraryVersions::open(const std::string& name,
                                              const std::filesystem::path& file,
                                              const std::string& expected,
                                              config::Problems& problems) {
  const config::Place place{.file = file.string(), .line = 0, .pointer = {}};
  const std::string library = "library \"" + name + "\"";
  const SealedCopy copy = seal_copy(name, file);
  if (copy.file < 0) {
    problems.add(config::make_error(place, library + " cannot be read: " + std::strerror(errno)));
    return {};
  }
  const std::lock_guard lock(mutex_);
  if (const auto known = open_.find(copy.sha256); known != open_.end()) {
    ::close(copy.file);
    return {.library = known->second, .sha256 = copy.sha256};
  }
  const auto refuse = [&copy]() -> Opened {
    ::close(copy.file);
    return {};
  };
  if (!expected.empty() && expected != copy.sha256) {
    problems.add(config::make_error(place, library + " was exchanged or written since it was tried",
                                    "try again when nothing writes it any more, such as a build"));
    return refuse();
  }
  if (!is_pinned(name, copy.sha256, problems) ||
      !has_right_note(name, path_of(copy), place, problems)) {
    return refuse();
  }
  // From the folders that its own file names; a copy would not find them.
  for (const NeededLibrary& needed : needed_libraries(file)) {
    if (is_library_loaded(needed.name)) {
      continue;
    }
    if (pins_) {
      problems.add(config::make_error(
          pins_->place, library + " needs " + needed.name + ", which this run has not loaded"));
      return refuse();
    }
    if (::dlopen(needed.file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE) == nullptr) {
      problems.add(config::make_error(place, library + " cannot be loaded: " + ::dlerror()));
      return refuse();
    }
  }
  void* const handle = ::dlopen(path_of(copy).c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  base::reset_floating_point();
  if (handle == nullptr) {
    problems.add(config::make_error(place, library + " cannot be loaded: " + ::dlerror()));
    return refuse();
  }
  const ComponentLibrary* const opened = library_in(handle, name, file, place, problems);
  if (opened != nullptr) {
    open_[copy.sha256] = opened;
  }
  return {.library = opened, .sha256 = copy.sha256};
}

}  // namespace fastcycle::host
