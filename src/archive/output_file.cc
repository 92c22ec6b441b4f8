#include "archive/output_file.h"

#include <cerrno>
#include <cstdio>
#include <string_view>
#include <system_error>
#include <utility>

#include <unistd.h>

#include "base/files.h"
#include "mcap/error.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, std::string expected, std::string found) {
  throw mcap::Error({.place = {.file = path.string()},
                     .record = {},
                     .expected = std::move(expected),
                     .found = std::move(found)});
}

fs::path checked(fs::path path, const OutputFile::Options& options) {
  std::error_code ignored;
  for (const fs::path& input : options.inputs) {
    if (fs::equivalent(input, path, ignored)) {
      refuse(path, "another file than those that are read", "one of them");
    }
  }
  if (fs::is_directory(path, ignored)) {
    refuse(path, "the name of a file", "a folder");
  }
  if (const fs::path folder = path.parent_path();
      !folder.empty() && !fs::is_directory(folder, ignored)) {
    refuse(path, "a name in a folder that is there", "no folder " + folder.string());
  }
  if (!options.may_replace && fs::exists(fs::symlink_status(path, ignored))) {
    refuse(path, "a name that is free", "a file (--force replaces it)");
  }
  return path;
}

fs::path beside(const fs::path& path) {
  fs::path name = path;
  name += "." + std::to_string(::getpid()) + ".tmp";
  return name;
}

}  // namespace

OutputFile::OutputFile(fs::path path, const Options& options)
    : path_(checked(std::move(path), options)),
      may_replace_(options.may_replace),
      unfinished_(beside(path_)),
      sink_(std::make_unique<mcap::FileSink>(unfinished_)) {}

OutputFile::~OutputFile() {
  if (!is_committed_) {
    std::error_code ignored;
    fs::remove(unfinished_, ignored);
  }
}

void OutputFile::commit() {
  sink_->sync();
  const int error = may_replace_
                        ? (std::rename(unfinished_.c_str(), path_.c_str()) == 0 ? 0 : errno)
                        : base::rename_to_free(unfinished_, path_);
  if (error != 0) {
    refuse(path_, "a name that it can get", std::system_category().message(error));
  }
  is_committed_ = true;
  base::sync_folder(path_.parent_path());
}

}  // namespace fastcycle::archive
