#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace fastcycle::base {

/// What readers find of a file that is being written.
struct FileState {
  enum class Kind : std::uint8_t {
    kThere,      ///< All of it, under its name.
    kElsewhere,  ///< All of it, but its name leads to nothing, to another file, or cannot be
                 ///< followed.
    kLost,       ///< It has no name any more, or was truncated.
  };

  Kind kind = Kind::kThere;
  std::string words = {};  ///< What happened to it: "it was deleted". Empty if it is there.
};

/// Checks an open file that was created as `name`, and has at least `size` bytes.
///
/// @threads  Safe.
[[nodiscard]] FileState look_at(int descriptor, const std::filesystem::path& name,
                                std::uint64_t size);

/// Renames a file, unless the new name exists. Returns 0, or the error: EEXIST if the name exists.
///
/// @threads  Safe.
[[nodiscard]] int rename_to_free(const std::filesystem::path& from,
                                 const std::filesystem::path& to);
/// The same for file systems that cannot do so: the file temporarily has both names.
[[nodiscard]] int link_to_free(const std::filesystem::path& from, const std::filesystem::path& to);

/// Renames a file to `wanted`, or to the next free one of `numbered`. Returns the name.
///
/// @threads  Safe.
/// @errors   `std::filesystem::filesystem_error`, on errors other than taken names.
[[nodiscard]] std::filesystem::path rename_to_next_free(const std::filesystem::path& from,
                                                        const std::filesystem::path& wanted);

/// `drive.mcap` and 2: `drive_0002.mcap`.
[[nodiscard]] std::filesystem::path numbered(const std::filesystem::path& path, unsigned number);

/// Syncs the directory `folder` to disk; empty is the working directory. Errors are ignored: some
/// file systems do not support it.
void sync_folder(const std::filesystem::path& folder) noexcept;

}  // namespace fastcycle::base
