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

/// The services by which ROS 2 tools read and change the parameters of a node, for parameters of
/// components that the gateway lists: `/fastcycle_gateway/get_parameters` and five more.
///
/// Changes are transactions of the application; the reason of a refusal is returned to ROS 2.
///
/// @threads  Confined to the component, except the `Arrival`s that it creates, and its counters.
class ParamServices {
 public:
  /// Called on the participant's thread with a request of the service with this number.
  using Arrival =
      std::function<void(std::size_t service, const Identity&, std::span<const std::byte>)>;
  /// Called with messages for the user.
  using Report = std::function<void(const std::string&)>;

  /// `node` includes its slash; the definitions provide the hashes.
  ///
  /// @errors  `ros2::DefinitionError`
  ParamServices(Context& context, const std::string& node, std::vector<ParamSettings> settings,
                ros2::Definitions& definitions, Report report);

  void open(Participant& participant, const Arrival& arrival);
  void close();
  /// A request of ROS 2. In an activation.
  void take(std::size_t service, const Identity& request, std::span<const std::byte> message);
  /// Listed parameters that do not exist. In an activation.
  [[nodiscard]] std::vector<std::string> unknown() const;

  [[nodiscard]] std::vector<Guid> readers() const;
  /// Requests lost on the way, or for lack of room.
  [[nodiscard]] std::uint64_t lost() const;
  [[nodiscard]] std::vector<Guid> writers() const;

  std::uint64_t asked = 0;     ///< Requests received.
  std::uint64_t answered = 0;  ///< Replies sent.
  std::uint64_t failed = 0;    ///< Invalid or excessive requests.

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
  /// A parameter visible to ROS 2.
  struct Seen {
    ParamInfo info;
    bool may_change = false;
  };
  using SeenByName = std::map<std::string, Seen, std::less<>>;
  /// Result of one change: empty, or why it was refused.
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
  const Report report_;
  std::array<End, kServices> ends_;
};

/// The result of `ListParameters` for these prefixes: those of `names` that are below one of them,
/// at most `depth` parts deep; 0: any depth. Without prefixes all names qualify.
[[nodiscard]] std::vector<std::string> listed_names(const std::vector<std::string>& names,
                                                    const std::vector<std::string>& prefixes,
                                                    std::uint64_t depth);

}  // namespace fastcycle::dds_gateway
