#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace fastcycle::mcap {

/// A place in a file.
struct Place {
  /// In the place of an offset: it is about the file as a whole, as when there is none.
  static constexpr std::uint64_t kWholeFile = std::numeric_limits<std::uint64_t>::max();

  std::string file;                   ///< The name that the source or sink gives it.
  std::uint64_t offset = kWholeFile;  ///< Of a record, or of what should be one.
  /// In the uncompressed records of the chunk that stands at `offset`.
  std::optional<std::uint64_t> offset_in_chunk{};
};

/// What is wrong with a file.
struct Problem {
  Place place;
  std::string record = {};    ///< `Chunk`; empty if it is not about a record.
  std::string expected = {};  ///< What should stand there.
  std::string found = {};     ///< What stands there.
};

/// `drive.mcap: byte 4711: Chunk: expected …, found …`, on one line. What is about the whole file
/// names no byte.
[[nodiscard]] std::string to_string(const Problem& problem);

/// A file is not what the format says (then it is a `Damage`), or cannot be read or written, or a
/// writer was asked for what the format forbids.
class Error : public std::runtime_error {
 public:
  explicit Error(Problem problem)
      : std::runtime_error(to_string(problem)), problem_(std::move(problem)) {}

  [[nodiscard]] const Problem& problem() const { return problem_; }

 private:
  Problem problem_;
};

/// The file could be read, but its content is wrong.
class Damage final : public Error {
 public:
  using Error::Error;
};

}  // namespace fastcycle::mcap
