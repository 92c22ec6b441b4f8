#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "mcap/file.h"

namespace fastcycle::tool {

/// The topics and fields that a page shows: docs/reference/page.md.
struct DriveView {
  std::string text;
  std::string name;  ///< For error messages.

  /// An empty `path` selects the page's default view.
  ///
  /// @errors  `std::runtime_error` if it cannot be read: see `config::read_file`.
  static DriveView read(const std::filesystem::path& path);
};

/// Whether this program was built with the page; if not, prints so in the name of `command`.
[[nodiscard]] bool has_drive_page(const std::string& command);

/// Writes the page that plays back a drive, with `title` and `data` (JSON, from
/// `archive::view_data`).
///
/// @errors  Those of the sink.
void write_drive_page(const std::string& title, std::string_view data, mcap::Sink& sink);

}  // namespace fastcycle::tool
