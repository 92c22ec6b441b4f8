#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "broker/publishing_component.h"

namespace google::protobuf {
class Message;
}

namespace fastcycle::detail {

class ComponentCore;

/// The states that one component declares by `Context::state`, and their key frames.
///
/// A key frame is the state after an activation. Its messages are published, each on a topic of its
/// own (`state_topic`), and the reads of that activation contain the rest of what FastCycle keeps
/// for the component: the messages in its views, the sequences of its publishers, changed params,
/// and the numbers of `FrameNumber`.
///
/// @threads  As `Actor`.
class DeclaredStates final : public KeyFrames {
 public:
  struct One {
    std::string name;
    std::unique_ptr<google::protobuf::Message> value;
    PublisherCore* publisher;
    std::function<void(google::protobuf::Message&)> save;  ///< Of the object; or null.
  };
  /// `ReadKind::kFrameNumber`: its place.
  enum FrameNumber : std::uint32_t {
    kTimersBegan,
    kRestarts,      ///< Within the time that began at the next one.
    kFirstRestart,  ///< ns since 1970.
    kObjects,       ///< Made before this one.
    kJobs,          ///< Offloaded so far.
    kParamsAsked,   ///< Changes that it asked for.
    kTransaction,   ///< The last that changed a param.
  };

  explicit DeclaredStates(ComponentCore& core);
  DeclaredStates(const DeclaredStates&) = delete;
  DeclaredStates& operator=(const DeclaredStates&) = delete;
  ~DeclaredStates() override;

  /// In the constructor of the object.
  ///
  /// @errors  A duplicate or invalid name is a start-up error; another type than before in an
  ///          object that is reconstructed throws `std::logic_error`.
  google::protobuf::Message& declare(std::string_view name,
                                     const google::protobuf::Message& default_instance,
                                     std::function<void(google::protobuf::Message&)> save);

  [[nodiscard]] const std::vector<std::unique_ptr<One>>& all() const noexcept { return all_; }

  /// Why it has no key frames; empty if it has.
  [[nodiscard]] std::string why_none() const;

  // As `KeyFrames`.
  void end_activation() override;
  void end_object() noexcept override;
  void change_params(std::uint64_t transaction, std::string_view text) override;

 private:
  [[nodiscard]] bool is_due();
  void write();
  static void save(One& one);

  ComponentCore& core_;
  std::vector<std::unique_ptr<One>> all_;
  std::int64_t next_ns_ = 0;  ///< Not before this time.
  std::uint64_t transaction_ = 0;
  std::unique_ptr<nlohmann::ordered_json> params_;  ///< All changed ones; null if none.
};

/// The topic of the key frames of one state.
[[nodiscard]] std::string state_topic(std::string_view component, std::string_view state);

}  // namespace fastcycle::detail
