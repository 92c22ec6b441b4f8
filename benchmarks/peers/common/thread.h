#pragma once

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <thread>
#include <utility>

#include <unistd.h>

namespace fastcycle::peers {

/// A thread that is joined when it goes out of scope. An exception of its function is printed and
/// ends the program, because the publisher would otherwise wait indefinitely.
template <typename Function>
[[nodiscard]] std::jthread start_thread(Function function) {
  return std::jthread([called = std::move(function)] {
    try {
      called();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "receiver: %s\n", error.what());
      _exit(EXIT_FAILURE);
    }
  });
}

}  // namespace fastcycle::peers
