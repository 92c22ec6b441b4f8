#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mcap/reader.h"

namespace fastcycle::tool {

/// The open files of one log.
class LogFiles {
 public:
  /// @errors  As `mcap::FileSource` and `mcap::Reader`.
  explicit LogFiles(const std::vector<std::filesystem::path>& files) {
    for (const std::filesystem::path& file : files) {
      sources_.push_back(std::make_unique<mcap::FileSource>(file));
      owned_.push_back(std::make_unique<mcap::Reader>(*sources_.back()));
      readers_.push_back(owned_.back().get());
      bytes_ += sources_.back()->size();
    }
    name_ = files.front().filename().string();
    if (files.size() > 1) {
      name_ += " to " + files.back().filename().string();
    }
  }

  [[nodiscard]] std::span<const mcap::Reader* const> readers() const { return readers_; }
  /// Of all files.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// For people: the name of the file, or of the first and the last one.
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::vector<std::unique_ptr<mcap::FileSource>> sources_;
  std::vector<std::unique_ptr<mcap::Reader>> owned_;
  std::vector<const mcap::Reader*> readers_;
  std::uint64_t bytes_ = 0;
  std::string name_;
};

}  // namespace fastcycle::tool
