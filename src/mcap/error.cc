#include "mcap/error.h"

#include <fmt/format.h>

namespace fastcycle::mcap {

std::string to_string(const Problem& problem) {
  std::string text = problem.place.file;
  if (problem.place.offset != Place::kWholeFile) {
    text += fmt::format(": byte {}", problem.place.offset);
  }
  if (problem.place.offset_in_chunk) {
    text += fmt::format(", byte {} of the chunk's records", *problem.place.offset_in_chunk);
  }
  if (!problem.record.empty()) {
    text += ": " + problem.record;
  }
  return text + ": expected " + problem.expected + ", found " + problem.found;
}

}  // namespace fastcycle::mcap
