#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include <fastcycle/fastcycle.h>

namespace kitti {

/// The sensors record ten frames a second.
inline constexpr std::int64_t kFrame_ns = 100'000'000;

/// One file of a stream, and its frame number.
struct Frame {
  std::int64_t number = 0;
  std::filesystem::path file;
};

/// The frames of a stream: the files of a folder named by numbers, `0000000112.bin.xz`, in their
/// order.
///
/// @errors  Throws `std::runtime_error`, with the folder, if there is none, if it has no such file,
///          or if a file is named by no number.
[[nodiscard]] std::vector<Frame> list_frames(const std::filesystem::path& folder,
                                             std::string_view suffix);

/// The begin of a frame after the application's start, which is also the end of the previous frame.
/// The first sweep of the drive begins when the application starts.
[[nodiscard]] inline fastcycle::Duration offset_of(std::int64_t number, std::int64_t first) {
  return fastcycle::Duration((number - first) * kFrame_ns);
}

}  // namespace kitti
