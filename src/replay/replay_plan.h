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

/// What is replayed, and into whom.
struct ReplayOptions {
  std::vector<std::filesystem::path> files = {};
  /// The components that run. Empty: all but those that subscribe to nothing and publish what the
  /// files have, such as drivers.
  std::vector<std::string> into = {};
  mcap::TopicFilter filter = {};  ///< Of the topics, as the files name them.
  std::map<std::string, std::string> remap =
      {};                              ///< Topic of the files → topic of the application.
  std::optional<Duration> start = {};  ///< Since the recorded run began.
  std::optional<Duration> end = {};    ///< The same.
  bool is_looped = false;              ///< At its end it goes on from its beginning.
};

/// One end of a topic, as a component declared it.
struct Connection {
  std::string component;
  std::string topic;
  std::string type;
  bool is_publisher = false;
};

/// All ends of all topics of an application that is built of `components`.
[[nodiscard]] std::vector<Connection> connections_of(const Components& components);

/// Who runs, and what comes from the recording instead.
struct ReplayPlan {
  /// What becomes of one stream of the recording.
  struct Stream {
    std::string topic = {};      ///< In the application.
    std::string component = {};  ///< In whose place it is published; empty: it is not fed.
    std::string reason = {};     ///< Why it is not fed; else empty.
    const google::protobuf::Descriptor* type = nullptr;  ///< Of what is fed.

    [[nodiscard]] bool is_fed() const { return !component.empty(); }
  };

  std::vector<Stream> streams;    ///< As in the recording.
  std::set<std::string> running;  ///< Components that are made and started.
  /// Those that the application gives, whether who serves them runs or not.
  std::set<std::string> services = {};
  /// Topics that several publish here, and that the application file gives to one: a tool published
  /// on them too when they were recorded.
  std::set<std::string> shared_topics = {};

  [[nodiscard]] bool runs(const std::string& component) const {
    return running.contains(component);
  }
  /// Whether something is published in the place of `component`.
  [[nodiscard]] bool stands_in_for(const std::string& component) const;
};

/// Decides it, for an application whose components have these `connections`. The libraries of all
/// of them are loaded: from them come the types.
///
/// A stream is fed if a component that runs subscribes to it, or `options` name its topic, and no
/// component that runs publishes it. What a tool published (`fastcycle topic pub`) is fed beside
/// what its component publishes, as it was then.
///
/// @errors  Mistakes and warnings go to `problems`: components that do not exist, nothing to feed,
///          types that do not fit, inputs that come from nowhere.
[[nodiscard]] ReplayPlan plan_replay(const ReplayOptions& options,
                                     const std::vector<record::RecordedStream>& streams,
                                     const config::ApplicationDescription& description,
                                     const std::vector<Connection>& connections,
                                     config::Problems& problems);

/// The application as the plan wants it: who does not run has nothing but its name and place, and
/// at the end stand those who published in the recording and are no components of it.
[[nodiscard]] config::ApplicationDescription describe_replay(
    config::ApplicationDescription description, const ReplayPlan& plan);

}  // namespace fastcycle::host
