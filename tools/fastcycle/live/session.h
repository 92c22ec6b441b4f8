#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "command.h"
#include "file_work.h"
#include "inspect/client.h"
#include "inspect/inspect.pb.h"
#include "stop_signals.h"

namespace fastcycle::tool::live {

namespace protocol = inspect::protocol;
using Json = nlohmann::ordered_json;

/// The options of every command on a running application.
struct Target {
  std::string application;  ///< Empty: the only running one.
  bool is_json = false;

  void add_application_to(CLI::App& line);
  void add_to(CLI::App& line, const std::string& json_help = "Print one JSON document");
};

/// For a command that works live or on a file, if `--live` was given: throws `Failure` if there is
/// an option other than `allowed`, or a file.
void require_live_only(const CLI::App& line, const std::vector<std::string>& allowed);
/// If it was not given: throws `Failure` if the file is missing, or `--app` is present.
void require_file(const CLI::App& line);

/// Ends a command with an error message and an exit code.
class Failure final : public std::runtime_error {
 public:
  Failure(int exit_code, const std::string& sentence)
      : std::runtime_error(sentence), exit_code_(exit_code) {}

  [[nodiscard]] int exit_code() const { return exit_code_; }

 private:
  int exit_code_;
};

/// Runs the body of a command and prints its errors: `fastcycle topic echo: …`.
int guarded(const std::string& command, const std::function<int()>& body);

/// A connection to the selected application, for one command.
///
///     Session session(target, "topic list");
///     const protocol::Overview overview = session.overview();
///
/// @threads  Confined.
/// @errors   `inspect::ClientError` and `Failure`; `guarded` prints them.
class Session {
 public:
  Session(const Target& target, const std::string& command);

  [[nodiscard]] inspect::Client& client() { return client_; }
  [[nodiscard]] protocol::Overview overview();
  /// One topic, with its schema. For an unknown topic, reports an error that names the nearest one.
  [[nodiscard]] protocol::Topic topic(const std::string& name);

 private:
  inspect::Client client_;
};

/// The streams of one command, followed until all have ended, the reader of standard output has
/// gone, or Ctrl-C.
///
/// @threads  Confined.
class Streams {
 public:
  /// Must be constructed before the first stream begins.
  explicit Streams(Session& session);

  protocol::Started begin(protocol::Request request, std::uint32_t* id = nullptr);

  /// Calls `give` with each answer; with null, if none came for a while. Returns when `give`
  /// returns false, or see above. With `drains`, answers in flight at Ctrl-C are still given.
  /// Without it the thread runs from here on as SCHED_IDLE: on an overloaded machine the output is
  /// delayed, or counted as lost, but the application is not affected.
  void follow(Output& output, const std::function<bool(const protocol::Answer*)>& give,
              bool drains = false);

  /// Whether Ctrl-C was pressed.
  [[nodiscard]] bool is_stopped() const { return is_stopped_; }
  /// Same effect as Ctrl-C.
  void stop() { is_stopped_ = true; }

 private:
  void end_all();

  inspect::Client& client_;
  std::vector<std::uint32_t> running_;
  std::atomic<bool> is_stopped_{false};
  const sigset_t signals_;
  const StopSignals stop_signals_;
};

/// `message` as JSON, with the names of the protocol: numbers are numbers, texts that contain JSON
/// (`value_json`) are embedded as JSON (`value`), and fields without a value are included. Schemas
/// are left out.
[[nodiscard]] Json json_of(const google::protobuf::Message& message);

/// Prints `json`, indented.
int print_json(const Json& json);
int print_text(const std::string& text);
/// `json` on one line.
[[nodiscard]] std::string json_line(const Json& json);

/// The names among `known` that match the patterns; all if there are none. A pattern without a
/// match is an error; `what` ("topic") names the kind.
[[nodiscard]] std::vector<std::string> choose(const std::vector<std::string>& known,
                                              const std::vector<std::string>& patterns,
                                              const std::string& what);
/// Throws `Failure` unless `name` is one of `known`.
void require_known(const std::string& name, const std::vector<std::string>& known,
                   const std::string& what);

[[nodiscard]] std::vector<std::string> names_of_topics(const protocol::Overview& overview,
                                                       bool with_services);
[[nodiscard]] std::vector<std::string> names_of_components(const protocol::Overview& overview);

/// How long the application's timers have been running, in the application's time.
[[nodiscard]] std::uint64_t uptime_ns(const protocol::Overview& overview);

}  // namespace fastcycle::tool::live
