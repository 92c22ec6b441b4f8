#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "mcap/file.h"

namespace fastcycle::tool {

/// Which topics and fields a page shows: docs/reference/page.md.
struct DriveView {
  std::string text;
  std::string name;  ///< For messages about what is wrong with it.

  /// An empty `path` is the view of the page itself.
  ///
  /// @errors  `std::runtime_error` if it cannot be read.
  static DriveView read(const std::filesystem::path& path);
};

/// Whether this program was built with the page; says in the name of `command` if not.
[[nodiscard]] bool has_drive_page(const std::string& command);

/// Writes the page that plays a drive, with `title` and `data` (JSON, of `archive::view_data`).
///
/// @errors  Those of the sink.
void write_drive_page(const std::string& title, std::string_view data, mcap::Sink& sink);

}  // namespace fastcycle::tool
