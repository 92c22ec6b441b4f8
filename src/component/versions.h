#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "config/value.h"
#include "fastcycle/library.h"
#include "fastcycle/time.h"

namespace fastcycle::detail {

/// The code that a component's objects are made of.
struct ComponentVersion {
  ComponentClass component_class{};
  std::string library;   ///< Its name, or its file: as it was asked for.
  std::string build_id;  ///< Hexadecimal digits; empty if the file has none.
};

/// What a reload is asked to do.
struct ReloadOrder {
  /// Deadlines that are missed without consequence: a component that was just replaced is late.
  static constexpr std::uint32_t kMissesForgiven = 2;

  ComponentVersion version;
  /// Upon those of the application file. What else was changed stays, in params of the same name.
  std::optional<config::Value> params;
  Duration probation{std::chrono::seconds(10)};
  std::uint32_t misses_forgiven = kMissesForgiven;
  /// What became of it: why it was not done, or empty. Called once, in an activation of the
  /// component.
  std::function<void(const std::string& why_not)> told;
};

/// What there is to say of a component's code.
struct VersionNews {
  std::string library;   ///< That runs now: as it was asked for.
  std::string build_id;  ///< Of its file; empty if it has none.
  bool is_on_probation = false;
  std::uint64_t reloads = 0;
  std::uint64_t rollbacks = 0;
  std::string last;  ///< What happened last, in words; empty if nothing did.

  bool operator==(const VersionNews&) const = default;
};

/// The code of one component, which may be replaced while it runs.
///
/// @threads  `note_miss`, `note_hang`, `is_on_probation` and `news` are Safe; all else in
/// activations of
///           the component.
class Versions {
 public:
  Versions() = default;
  Versions(const Versions&) = delete;
  Versions& operator=(const Versions&) = delete;
  virtual ~Versions() = default;

  /// Replaces the object. Messages that come meanwhile wait. If the new version cannot be started,
  /// the old one goes on, with its state. `order.told` is called with what came of it.
  virtual void reload(const std::shared_ptr<const ReloadOrder>& order) = 0;
  /// Returns to the version before, with the present state. Returns why that cannot be done; empty
  /// if it was, or will be, once the threads of the object have ended.
  [[nodiscard]] virtual std::string roll_back(const std::string& why) = 0;
  /// Ends the probation: the present version stays. Returns why that cannot be done.
  [[nodiscard]] virtual std::string confirm(const std::string& why) = 0;

  /// After a callback threw `what`: whether that was of a version on probation. Then the one before
  /// is back, or will be, once the threads of the object have ended.
  [[nodiscard]] virtual bool take_fault(const std::string& what) = 0;
  /// Something ended what was under way: a fault, or the end of the component.
  virtual void interrupted(const std::string& what) = 0;
  /// The timers of the component were made anew.
  virtual void watch() = 0;
  /// What it publishes misses deadlines. More than are forgiven take the reload back.
  virtual void note_miss(const std::string& what) = 0;
  /// A call takes longer than it may: the reload is taken back as soon as it returns.
  virtual void note_hang(const std::string& what) = 0;

  /// Whether it is judged at all. Safe.
  [[nodiscard]] virtual bool is_on_probation() const noexcept = 0;
  [[nodiscard]] virtual VersionNews news() const = 0;
  /// Objects that were made by reloads and rollbacks. As `ComponentCore::restart_count`.
  [[nodiscard]] virtual std::uint64_t exchanges() const noexcept = 0;
  /// The params that the present object is made with; null: those of the file.
  [[nodiscard]] virtual const config::Value* params() const noexcept = 0;
  /// While an object of a reload is made: the params that the order names; else null.
  [[nodiscard]] virtual const config::Value* ordered_params() const noexcept = 0;
};

}  // namespace fastcycle::detail
