#pragma once

namespace fastcycle::tool {

/// Tells the service manager that started this process, if one asks for it by `NOTIFY_SOCKET`, as
/// systemd does for a service of `Type=notify`.
///
/// @threads  Safe. Never blocks: without a reader, or where the reader's queue is full, nothing is
/// sent.
/// Source of the protocol: sd_notify(3).
void report_started() noexcept;   ///< All components are started.
void report_stopping() noexcept;  ///< The run ends.

}  // namespace fastcycle::tool
