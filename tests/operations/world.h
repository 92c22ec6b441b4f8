#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace fastcycle::operations {

/// What a player may do whenever it is called.
enum class Operation : std::uint8_t {
  kPublish,         ///< On its own topic, or on the one that all share, by one of two publishers.
  kForward,         ///< A sample that it received, or one that a view shows.
  kKeep,            ///< Keeps a sample, for long, or lets go of all.
  kSubscribe,       ///< To a topic that there is, or to one that nobody knew.
  kUnsubscribe,     ///< Ends one of its late subscriptions, perhaps the one whose callback runs.
  kNest,            ///< A subscription whose callback owns another one.
  kCall,            ///< Calls a service, with or without a deadline.
  kInsist,          ///< Calls, and calls again for each refusal, many times.
  kCancel,          ///< Cancels its calls and goals.
  kSendGoal,        ///< Sends a goal.
  kAnswer,          ///< Answers a request that it had kept, or lets go of it.
  kArm,             ///< Arms one of its timers.
  kDisarm,          ///< Cancels one of its timers.
  kOffload,         ///< Work beside its callbacks, which keeps a sample.
  kChangeParams,    ///< Of itself and others, sometimes to what is not allowed.
  kSwitchMode,      ///< To any mode.
  kSendTiles,       ///< As many messages as there are credits.
  kLook,            ///< At its views.
  kSay,             ///< Health, a line of the log, a result.
  kRenew,           ///< Has another component made anew, as an observer may.
  kFault,           ///< Throws, wherever it is.
  kFaultInEvent,    ///< Throws in a callback for events.
  kFaultInLife,     ///< Throws in start, activate, deactivate, stop, or when it is made anew.
  kFaultInOffload,  ///< The work throws.
  kCount,
};

inline constexpr std::size_t kOperations = static_cast<std::size_t>(Operation::kCount);

[[nodiscard]] std::string_view to_word(Operation operation) noexcept;

/// What the players of one run share, and what is observed of them.
struct World {
  std::array<bool, kOperations> is_allowed{};
  bool is_live = true;
  /// Off until the application runs, and at its end: then players only listen.
  std::atomic<bool> is_wild{false};
  std::array<std::atomic<std::uint64_t>, kOperations> done{};
  std::atomic<int> objects{0};
  std::atomic<std::uint64_t> pings{0};  ///< The last that was published.
  /// The last ping that each player received. The places are made before the run.
  std::map<std::string, std::atomic<std::uint64_t>> received;

  void begin(bool live);
  [[nodiscard]] std::uint64_t total() const noexcept;
};

extern World g_world;

}  // namespace fastcycle::operations
