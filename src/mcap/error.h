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
  /// As an offset: the problem concerns the file as a whole, or there is no file.
  static constexpr std::uint64_t kWholeFile = std::numeric_limits<std::uint64_t>::max();

  std::string file;                   ///< The name of the source or sink.
  std::uint64_t offset = kWholeFile;  ///< Of a record, or of the place where one is expected.
  /// Offset in the uncompressed records of the chunk at `offset`.
  std::optional<std::uint64_t> offset_in_chunk{};
};

/// A problem in a file.
struct Problem {
  Place place;
  std::string record = {};    ///< `Chunk`; empty if no record is concerned.
  std::string expected = {};  ///< Expected content.
  std::string found = {};     ///< Actual content.
};

/// `drive.mcap: byte 4711: Chunk: expected …, found …`, on one line. Without a byte if the whole
/// file is concerned.
[[nodiscard]] std::string to_string(const Problem& problem);

/// A file violates the format (then it is a `Damage`), cannot be read or written, or a writer was
/// asked for what the format forbids.
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
