#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::test {

inline std::vector<std::string> lines_of(std::istream&& stream) {
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
  }
  return lines;
}

inline std::vector<std::string> lines_of(const std::filesystem::path& file) {
  return lines_of(std::ifstream(file));
}

/// Whether `line` contains `part`, in which "…" stands for any text.
inline bool contains(std::string_view line, std::string_view part) {
  constexpr std::string_view kGap = "…";
  while (!part.empty()) {
    const std::size_t end = part.find(kGap);
    const std::string_view piece = part.substr(0, end);
    const std::size_t at = line.find(piece);
    if (at == std::string_view::npos) {
      return false;
    }
    line.remove_prefix(at + piece.size());
    part.remove_prefix(end == std::string_view::npos ? part.size() : end + kGap.size());
  }
  return true;
}

inline bool any_contains(const std::vector<std::string>& lines, std::string_view part) {
  return std::ranges::any_of(lines, [&](const auto& line) { return contains(line, part); });
}

/// The names of the folders in `folder`, sorted.
inline std::vector<std::string> folders_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

}  // namespace fastcycle::test
