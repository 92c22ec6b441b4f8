#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/priority_mutex.h"
#include "broker/quality.h"
#include "component/versions.h"
#include "config/value.h"
#include "params/param_table.h"

namespace google::protobuf {
class Message;
}

namespace fastcycle::detail {

class ComponentCore;

/// Replaces the object of a component by one of another library, and rolls that back while the new
/// one is on probation: owns both versions, the state that was handed over, and the verdict.
///
/// The declared state is passed from one object to the next. After a fault or a call that hung, a
/// rollback restores the state that the old version had handed over; otherwise it takes the state
/// that the new one saved at its end.
///
/// @threads  As `Versions`.
class Reloading final : public Versions, private Watch {
 public:
  /// @pre `core` has its description and its class.
  explicit Reloading(ComponentCore& core);

  // As `Versions`.
  void reload(const std::shared_ptr<const ReloadOrder>& order) override;
  [[nodiscard]] std::string roll_back(const std::string& why) override;
  [[nodiscard]] std::string confirm(const std::string& why) override;
  [[nodiscard]] bool take_fault(const std::string& what) override;
  void interrupted(const std::string& what) override { answer(what); }
  void watch() override;
  void note_miss(const std::string& what) override;
  void note_hang(const std::string& what) override;
  [[nodiscard]] bool is_on_probation() const noexcept override { return is_on_probation_.load(); }
  [[nodiscard]] VersionNews news() const override;
  [[nodiscard]] std::uint64_t exchanges() const noexcept override { return exchanges_; }
  [[nodiscard]] const config::Value* params() const noexcept override {
    return params_ ? &*params_ : nullptr;
  }
  [[nodiscard]] const config::Value* ordered_params() const noexcept override {
    return ordered_params_;
  }

 private:
  using States = std::vector<std::unique_ptr<google::protobuf::Message>>;

  // As `Watch`: the end of the probation.
  void begin(std::int64_t) noexcept override {}
  std::optional<QosEvent> look(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t next_look_ns() const noexcept override;

  /// Answers the request for the reload, unless it was answered before.
  void answer(const std::string& why_not);
  /// Whether the probation continues; ends it if its time has passed.
  [[nodiscard]] bool is_judged();
  /// Deactivates and stops the object, ends its threads, then calls `next`.
  void end_in_order(const std::function<void()>& next);
  void exchange(const ReloadOrder& order);
  /// `keeps_state`: the present one; else what was handed over.
  void return_to_previous(bool keeps_state, const std::string& why);
  /// Restores the version in `before_`.
  void put_back();
  void ask_for_rollback(const std::string& why);
  [[nodiscard]] States copy_of_states() const;
  void set_states(const States& states);
  /// Reports `what` in the log, on the status topic, and in `news`.
  void report(const std::string& what, bool is_trouble);

  ComponentCore& core_;
  /// What a rollback returns to.
  struct Before {
    ComponentVersion version;
    std::optional<config::Value> params;
    std::optional<config::Value> ordered;  ///< Those that the order had changed, and their
    std::vector<host::ParamTable::Kept> param_values;  ///< earlier values.
    States states;
  };
  std::optional<Before> before_;
  std::function<void(const std::string& why_not)>
      on_result_;  ///< Answers the request for a reload; or null.
  std::optional<config::Value> params_;
  const config::Value* ordered_params_ = nullptr;
  std::int64_t ends_ns_ = 0;  ///< When the probation does, on the application's clock.
  std::uint64_t exchanges_ = 0;
  std::atomic<bool> is_on_probation_{false};
  std::atomic<bool> is_rollback_asked_{false};
  std::atomic<std::uint32_t> misses_{0};
  std::atomic<std::uint32_t> misses_forgiven_{0};
  std::atomic<bool> is_end_asked_{false};

  mutable base::PriorityMutex mutex_;
  VersionNews news_;
};

}  // namespace fastcycle::detail
