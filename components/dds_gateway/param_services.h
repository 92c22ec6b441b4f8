#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dds_gateway/engine.h"
#include "dds_gateway/ros_params.h"
#include "dds_gateway/settings.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/param_list.h"
#include "ros2/definition.h"

namespace fastcycle::dds_gateway {

/// The services by which tools of ROS 2 read and change the parameters of a node, for parameters of
/// components that the gateway lists: `/fastcycle_gateway/get_parameters` and five more.
///
/// Changes are made by transactions of the application; what these refuse is the reason that ROS 2
/// is given.
///
/// @threads  Confined to the component, but for the `Arrival`s that it makes, and for its counters.
class ParamServices {
 public:
  /// Called on the participant's thread with a request of the service with this number.
  using Arrival =
      std::function<void(std::size_t service, const Identity&, std::span<const std::byte>)>;
  /// Called with what should be told.
  using Tell = std::function<void(const std::string&)>;

  /// `node` has its slash; the definitions say the hashes.
  ///
  /// @errors  `ros2::DefinitionError`
  ParamServices(Context& context, const std::string& node, std::vector<ParamSettings> settings,
                ros2::Definitions& definitions, Tell tell);

  void open(Participant& participant, const Arrival& arrival);
  void close();
  /// A request of ROS 2. In an activation.
  void take(std::size_t service, const Identity& request, std::span<const std::byte> message);
  /// What is listed, and there is no such parameter. In an activation.
  [[nodiscard]] std::vector<std::string> unknown() const;

  [[nodiscard]] std::vector<Guid> readers() const;
  [[nodiscard]] std::vector<Guid> writers() const;

  std::uint64_t asked = 0;     ///< Requests that came.
  std::uint64_t answered = 0;  ///< Replies that went to who asked.
  std::uint64_t failed = 0;    ///< Requests that are no message, or ask for too much.

 private:
  enum Service : std::uint8_t { kGet, kTypes, kDescribe, kList, kSet, kSetAtomically, kServices };

  struct End {
    std::string name;
    std::string request_type;
    std::string reply_type;
    std::string request_hash;
    std::string reply_hash;
    std::unique_ptr<Reader> reader;
    std::unique_ptr<Writer> writer;
  };
  /// A parameter that ROS 2 may see.
  struct Seen {
    ParamInfo info;
    bool may_change = false;
  };
  using SeenByName = std::map<std::string, Seen, std::less<>>;
  /// What became of one change: nothing, or why it was not made.
  using Reason = std::string;

  [[nodiscard]] SeenByName seen() const;
  void answer(Service service, const Identity& request, ros2::CdrReader& in);
  void list(ros2::CdrReader& in, ros2::CdrWriter& out) const;
  void set(const Identity& request, const std::vector<RosParam>& params);
  void set_atomically(const Identity& request, const std::vector<RosParam>& params);
  [[nodiscard]] static Reason change_of(const SeenByName& seen, const RosParam& param,
                                        std::vector<ParamChange>& changes);
  void send(Service service, const Identity& request, ros2::Buffer& message);
  void fail(Service service, const std::string& why);

  Context& context_;
  const std::vector<ParamSettings> settings_;
  const Tell tell_;
  std::array<End, kServices> ends_;
};

/// The names of parameters that `ListParameters` gives of `names` for these prefixes: all that are
/// below one of them, at most `depth` parts deep below it; 0: any. Without prefixes it is below
/// everything.
[[nodiscard]] std::vector<std::string> listed_names(const std::vector<std::string>& names,
                                                    const std::vector<std::string>& prefixes,
                                                    std::uint64_t depth);

}  // namespace fastcycle::dds_gateway
