#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "fastcycle/message.h"

namespace fastcycle::detail {
class PublisherCore;
}

namespace fastcycle::host {

/// Receives all messages of the components that an `ExactReplay` executes, recorded and new ones.
///
/// @threads  Called by one worker at a time; it must not call the `ExactReplay`.
class OutputListener {
 public:
  OutputListener() = default;
  OutputListener(const OutputListener&) = delete;
  OutputListener& operator=(const OutputListener&) = delete;
  virtual ~OutputListener() = default;

  /// In the order of the log.
  virtual void is_recorded(const detail::PublisherCore& publisher, const MessageInfo& info,
                           std::string_view bytes) = 0;

  /// Origin of a new message.
  struct Source {
    std::uint64_t activation = 0;
    std::string_view cause;    ///< In words.
    std::int64_t time_ns = 0;  ///< Of the activation, since 1970.
  };
  /// In the order in which each component publishes.
  virtual void is_published(const detail::PublisherCore& publisher, const Source& source,
                            std::uint64_t sequence, std::string_view bytes) = 0;

  /// After all that `component` published in an activation at this time.
  virtual void has_executed(const std::string& component, std::int64_t time_ns) = 0;
};

}  // namespace fastcycle::host
