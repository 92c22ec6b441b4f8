#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "component/component_host.h"
#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/time.h"
#include "mcap/topic_filter.h"
#include "record/recording_reader.h"

namespace google::protobuf {
class Descriptor;
}

namespace fastcycle::host {

/// What is replayed, and into which components.
struct ReplayOptions {
  std::vector<std::filesystem::path> files = {};
  /// The components that run. Empty: all but those that subscribe to nothing and whose topics are
  /// recorded, such as drivers.
  std::vector<std::string> into = {};
  mcap::TopicFilter filter = {};  ///< Of the topics, as the files name them.
  std::map<std::string, std::string> remap =
      {};                              ///< Topic of the files → topic of the application.
  std::optional<Duration> start = {};  ///< Since the recorded run began.
  std::optional<Duration> end = {};    ///< The same.
  bool is_looped = false;              ///< Starts over at the end.
};

/// One end of a topic, as a component declared it.
struct Connection {
  std::string component;
  std::string topic;
  std::string type;
  bool is_publisher = false;
};

/// All topic ends of an application built of `components`.
[[nodiscard]] std::vector<Connection> connections_of(const Components& components);

/// Which components run, and what comes from the recording instead.
struct ReplayPlan {
  /// How one stream of the recording is used.
  struct Stream {
    std::string topic = {};      ///< In the application.
    std::string component = {};  ///< It is published in the name of this one; empty: it is not fed.
    std::string reason = {};     ///< Why it is not fed; else empty.
    const google::protobuf::Descriptor* type = nullptr;  ///< Of what is fed.

    [[nodiscard]] bool is_fed() const { return !component.empty(); }
  };

  std::vector<Stream> streams;    ///< As in the recording.
  std::set<std::string> running;  ///< Components that are constructed and started.
  /// Those that the application provides, whether or not their server runs.
  std::set<std::string> services = {};
  /// Topics with several publishers here, of which the application file declares one: a tool
  /// published on them too when they were recorded.
  std::set<std::string> shared_topics = {};

  [[nodiscard]] bool runs(const std::string& component) const {
    return running.contains(component);
  }
  /// Whether anything is published in the name of `component`.
  [[nodiscard]] bool stands_in_for(const std::string& component) const;
};

/// Plans the replay, for an application whose components have these `connections`. The libraries of
/// all of them are loaded, and provide the types.
///
/// A stream is fed if a running component subscribes to it, or `options` name its topic, and no
/// running component publishes it. What a tool published (`fastcycle topic pub`) is fed in addition
/// to what its component publishes, as in the recorded run.
///
/// @errors  Errors and warnings go to `problems`: components that do not exist, nothing to feed,
///          mismatching types, inputs without a source.
[[nodiscard]] ReplayPlan plan_replay(const ReplayOptions& options,
                                     const std::vector<record::RecordedStream>& streams,
                                     const config::ApplicationDescription& description,
                                     const std::vector<Connection>& connections,
                                     config::Problems& problems);

/// The application for the plan: components that do not run have only their name and place, and
/// publishers of the recording that are no components of it are appended.
[[nodiscard]] config::ApplicationDescription describe_replay(
    config::ApplicationDescription description, const ReplayPlan& plan);

}  // namespace fastcycle::host
