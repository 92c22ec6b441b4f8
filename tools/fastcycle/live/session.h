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

/// What every command on a running application accepts.
struct Target {
  std::string application;  ///< Empty: the only one that runs.
  bool is_json = false;

  void add_application_to(CLI::App& line);
  void add_to(CLI::App& line, const std::string& json_help = "One JSON document");
};

/// The command can do its work live or on a file, and `--live` was given: `Failure` if there is an
/// option which is none of `allowed`, or a file.
void require_live_only(const CLI::App& line, const std::vector<std::string>& allowed);
/// It was not given: `Failure` if the file is missing, or `--app` is there.
void require_file(const CLI::App& line);

/// What ends a command: a sentence for people, and the exit code.
class Failure final : public std::runtime_error {
 public:
  Failure(int exit_code, const std::string& sentence)
      : std::runtime_error(sentence), exit_code_(exit_code) {}

  [[nodiscard]] int exit_code() const { return exit_code_; }

 private:
  int exit_code_;
};

/// Runs what a command does; what goes wrong is printed: `fastcycle topic echo: …`.
int guarded(const std::string& command, const std::function<int()>& body);

/// A connection to the application that is meant, and what one command does with it.
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
  /// One topic, its schema included. What is no topic is a mistake that names the nearest.
  [[nodiscard]] protocol::Topic topic(const std::string& name);

 private:
  inspect::Client client_;
};

/// The streams of one command: what they bring, until all have ended, nobody reads what is printed,
/// or Ctrl-C.
///
/// @threads  Confined.
class Streams {
 public:
  /// Made before the first stream begins.
  explicit Streams(Session& session);

  protocol::Started begin(protocol::Request request, std::uint32_t* id = nullptr);

  /// Calls `give` with each answer; with null, if none came for a while. Returns when `give`
  /// returns false, or see above. With `drains`, what was under way at Ctrl-C is still given.
  /// Without it the thread runs from here on as SCHED_IDLE: on a full machine what is shown gets
  /// late, or is counted as lost, and the application does not.
  void follow(Output& output, const std::function<bool(const protocol::Answer*)>& give,
              bool drains = false);

  /// Ctrl-C came.
  [[nodiscard]] bool is_stopped() const { return is_stopped_; }
  /// As Ctrl-C.
  void stop() { is_stopped_ = true; }

 private:
  void end_all();

  inspect::Client& client_;
  std::vector<std::uint32_t> running_;
  std::atomic<bool> is_stopped_{false};
  const sigset_t signals_;
  const StopSignals stop_signals_;
};

/// What `message` says as JSON, with the names of the protocol: numbers are numbers, texts that are
/// JSON (`value_json`) are what they say (`value`); what has no value stands there as well. Schemas
/// are left out.
[[nodiscard]] Json json_of(const google::protobuf::Message& message);

/// Prints `json`, indented.
int print_json(const Json& json);
/// Prints `text`.
int print_text(const std::string& text);
/// `json` on one line.
[[nodiscard]] std::string json_line(const Json& json);

/// The names among `known` that the patterns mean, all without any. One that means nothing is a
/// mistake, `what` ("topic") says of what.
[[nodiscard]] std::vector<std::string> choose(const std::vector<std::string>& known,
                                              const std::vector<std::string>& patterns,
                                              const std::string& what);
/// `name` is one of `known`; else `Failure`.
void require_known(const std::string& name, const std::vector<std::string>& known,
                   const std::string& what);

[[nodiscard]] std::vector<std::string> names_of_topics(const protocol::Overview& overview,
                                                       bool with_services);
[[nodiscard]] std::vector<std::string> names_of_components(const protocol::Overview& overview);

/// How long the application's timers have been running, in its own time.
[[nodiscard]] std::uint64_t uptime_ns(const protocol::Overview& overview);

}  // namespace fastcycle::tool::live
