#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "archive/progress.h"
#include "archive/rewrite.h"
#include "mcap/error.h"
#include "mcap/file.h"

namespace fastcycle::rosbag {

/// The outcome for the messages of one topic.
struct Topic {
  std::string name;
  std::string type;  ///< Of ROS.
  std::uint64_t messages = 0;
  bool is_converted = false;  ///< Else it was copied unchanged.
  /// Messages that could not be read and are missing; `error` is that of the first.
  std::uint64_t unreadable = 0;
  std::string error;
};

struct Converted {
  std::uint64_t messages = 0;           ///< Written.
  std::vector<Topic> topics;            ///< In the order of their names.
  std::vector<mcap::Problem> problems;  ///< Of an input that was not closed.
};

/// Whether a file contains messages serialized by ROS 2.
///
/// @errors  `mcap::Error`
[[nodiscard]] bool is_rosbag(const mcap::Source& source);

/// Writes the messages of a bag in the order of their log times: those of known types as protobuf,
/// on the topic of the same name without the leading slash; others unchanged. Attachments and
/// metadata are written before them.
///
/// @errors  `mcap::Error`, also a `Damage` of the input.
Converted convert(const mcap::Source& source, mcap::Sink& sink, const archive::Layout& layout,
                  const archive::Progress& progress = {});

}  // namespace fastcycle::rosbag
