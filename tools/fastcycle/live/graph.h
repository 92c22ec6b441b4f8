#pragma once

#include <functional>
#include <string>

#include <CLI/App.hpp>

namespace fastcycle::tool::live {

/// The options of `fastcycle graph` for a running application.
struct GraphOptions {
  bool is_asked = false;
  std::string application;  ///< Empty: the only running one.
  std::string span = "1s";  ///< Over which rates are measured.

  /// The application's file is then no longer required.
  void add_to(CLI::App& line);

  /// Calls `write` with the graph of the running application, with its rates, latencies and losses,
  /// or `of_file` where none is asked for. Returns the exit code.
  [[nodiscard]] int run(const CLI::App& line, const std::function<int()>& of_file,
                        const std::function<int(const std::string& dot)>& write) const;
};

}  // namespace fastcycle::tool::live
