#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace fastcycle::base {

/// The GNU build id among the ELF notes of `size` bytes at `notes`, as hexadecimal digits; else
/// empty.
[[nodiscard]] std::string find_build_id(const std::byte* notes, std::size_t size);

/// The build id of the program or library of this process in which `address` lies; empty if it has
/// none.
///
/// @threads  Safe.
[[nodiscard]] std::string build_id_at(const void* address);

/// Calls `take` for the program and each library of this process that has a build id, with the name
/// of its file, which is empty for the program.
void for_each_build_id(
    const std::function<void(const std::string& file, const std::string& build_id)>& take);

}  // namespace fastcycle::base
