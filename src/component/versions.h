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
  std::string library;   ///< Its name, or its file: as requested.
  std::string build_id;  ///< Hexadecimal digits; empty if the file has none.
};

/// A request for a reload.
struct ReloadOrder {
  /// Missed deadlines without consequence: a component that was just replaced is late.
  static constexpr std::uint32_t kMissesForgiven = 2;

  ComponentVersion version;
  /// Override those of the application file. Other changed values are kept, for params of the same
  /// name.
  std::optional<config::Value> params;
  Duration probation{std::chrono::seconds(10)};
  std::uint32_t misses_forgiven = kMissesForgiven;
  /// Receives the result: why it was not done, or empty. Called once, in an activation of the
  /// component.
  std::function<void(const std::string& why_not)> on_result;
};

/// A summary of a component's code.
struct VersionNews {
  std::string library;   ///< The one that runs now: as requested.
  std::string build_id;  ///< Of its file; empty if it has none.
  bool is_on_probation = false;
  std::uint64_t reloads = 0;
  std::uint64_t rollbacks = 0;
  std::string last;  ///< The last event, as text; empty if none.

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

  /// Replaces the object. Messages wait meanwhile. If the new version cannot be started, the old
  /// one continues, with its state. `order.on_result` receives the result.
  virtual void reload(const std::shared_ptr<const ReloadOrder>& order) = 0;
  /// Returns to the version before, with the present state. Returns why that cannot be done; empty
  /// if it was, or will be, once the threads of the object have ended.
  [[nodiscard]] virtual std::string roll_back(const std::string& why) = 0;
  /// Ends the probation: the present version stays. Returns why that cannot be done.
  [[nodiscard]] virtual std::string confirm(const std::string& why) = 0;

  /// Called after a callback threw `what`. True if the version was on probation: then the previous
  /// one is back, or will be, once the threads of the object have ended.
  [[nodiscard]] virtual bool take_fault(const std::string& what) = 0;
  /// A reload in progress was ended: by a fault, or the end of the component.
  virtual void interrupted(const std::string& what) = 0;
  /// The timers of the component were created again.
  virtual void watch() = 0;
  /// A publisher missed a deadline. More than are forgiven roll the reload back.
  virtual void note_miss(const std::string& what) = 0;
  /// A call exceeds its limit: the reload is rolled back as soon as it returns.
  virtual void note_hang(const std::string& what) = 0;

  /// Whether it is on probation. Safe.
  [[nodiscard]] virtual bool is_on_probation() const noexcept = 0;
  [[nodiscard]] virtual VersionNews news() const = 0;
  /// Number of objects constructed by reloads and rollbacks. As `ComponentCore::restart_count`.
  [[nodiscard]] virtual std::uint64_t exchanges() const noexcept = 0;
  /// The params of the present object; null: those of the file.
  [[nodiscard]] virtual const config::Value* params() const noexcept = 0;
  /// While an object of a reload is constructed: the params in the order; else null.
  [[nodiscard]] virtual const config::Value* ordered_params() const noexcept = 0;
};

}  // namespace fastcycle::detail
