#pragma once

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <thread>
#include <utility>

#include <unistd.h>

namespace fastcycle::peers {

/// A thread that is joined when it goes out of scope. What its function throws is said, and ends
/// the program: the publisher would only wait for what never comes.
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
