#pragma once

#include <functional>
#include <thread>

#include "terminal_modes.h"

namespace fastcycle::tool {

/// Reads keys from the terminal one by one as they are pressed, without echo; see `TerminalModes`
/// for the state of the terminal. At most one instance exists at a time.
///
/// @threads  Confined to its owner; `on_key` is called on a separate thread.
class TerminalKeys {
 public:
  explicit TerminalKeys(std::function<void(char key)> on_key);
  TerminalKeys(const TerminalKeys&) = delete;
  TerminalKeys& operator=(const TerminalKeys&) = delete;
  ~TerminalKeys();

 private:
  void read();

  const std::function<void(char key)> on_key_;
  int end_[2] = {-1, -1};  ///< A pipe: writing to it ends the thread.
  const TerminalModes modes_;
  std::thread thread_;
};

}  // namespace fastcycle::tool
