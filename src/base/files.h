#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace fastcycle::base {

/// What readers find of a file that somebody writes.
struct FileState {
  enum class Kind : std::uint8_t {
    kThere,      ///< All of it, under its name.
    kElsewhere,  ///< All of it, but its name leads to nothing, to another file, or cannot be
                 ///< followed.
    kLost,       ///< It has no name any more, or others cut it off.
  };

  Kind kind = Kind::kThere;
  std::string words = {};  ///< What became of it: "it was deleted". Empty where it is there.
};

/// Looks what became of an open file that was made as `name`, and has `size` bytes at least.
///
/// @threads  Safe.
[[nodiscard]] FileState look_at(int descriptor, const std::filesystem::path& name,
                                std::uint64_t size);

/// Gives a file another name, unless something has that already. Returns 0, or the error: EEXIST if
/// something has the name.
///
/// @threads  Safe.
[[nodiscard]] int rename_to_free(const std::filesystem::path& from,
                                 const std::filesystem::path& to);
/// The same where the file system cannot rename so: with a second name that the file has for a
/// moment.
[[nodiscard]] int link_to_free(const std::filesystem::path& from, const std::filesystem::path& to);

/// Gives a file the name `wanted`, or the next one that is free, as `numbered` makes them. Returns
/// the name.
///
/// @threads  Safe.
/// @errors   `std::filesystem::filesystem_error`, if there is a reason other than that the names
/// are
///           taken.
[[nodiscard]] std::filesystem::path rename_to_next_free(const std::filesystem::path& from,
                                                        const std::filesystem::path& wanted);

/// `drive.mcap` and 2: `drive_0002.mcap`.
[[nodiscard]] std::filesystem::path numbered(const std::filesystem::path& path, unsigned number);

/// Gets the names of files in `folder` onto the disk; empty is the working folder. Errors are
/// ignored: some file systems cannot.
void sync_folder(const std::filesystem::path& folder) noexcept;

}  // namespace fastcycle::base
