#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/priority_mutex.h"
#include "component/versions.h"
#include "config/problem.h"
#include "fastcycle/qos.h"
#include "fastcycle/time.h"
#include "host/life_changes.h"
#include "loading/library_versions.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;
class Chains;
class Wiring;

/// A tool's request for another library of a component.
struct ReloadRequest {
  std::string library;     ///< Its name, or its file.
  std::string class_name;  ///< Empty: the library's only one.
  std::string params;  ///< A JSON object that overrides the component's params; empty: no changes.
  Duration probation{std::chrono::seconds(10)};  ///< 0: none.
  std::uint32_t misses_forgiven = detail::ReloadOrder::kMissesForgiven;
};

/// Replaces components by those of other libraries while the application runs: owns the loaded
/// libraries, their trial in a child process, and the violations of chains and deadlines by
/// components on probation.
///
/// @threads  `reload`, `deadline_missed` and `chain_breached` are Safe; `end` on the control
///           thread.
class Reloads {
 public:
  /// All outlive this.
  Reloads(ApplicationHost& application, const Wiring& wiring, const Chains& chains,
          LifeChanges& life_changes);
  Reloads(const Reloads&) = delete;
  Reloads& operator=(const Reloads&) = delete;
  ~Reloads();

  /// Sets where libraries are searched before the application's own path. Before the start.
  void set_library_path(std::vector<std::filesystem::path> library_path) {
    library_path_ = std::move(library_path);
  }

  /// Tries the library, then reloads the component from it in its process. `done` is called as by
  /// `LifeChanges::make`, or on a thread of this.
  void reload(detail::ComponentCore& component, const ReloadRequest& request,
              LifeChanges::Done done);
  /// Rejects further trials. The destructor waits for the running one.
  void end();

  /// A deadline was missed.
  void deadline_missed(const QosEvent& event);
  /// A message was too late for the chain with this index in the file.
  void chain_breached(std::size_t chain);

 private:
  using BreachCounts =
      std::map<std::string, std::uint64_t>;  ///< Breaches due to a component, by chain.

  /// The order for the component's process, as JSON; none after adding to `problems`.
  std::optional<nlohmann::json> try_out(const detail::ComponentCore& component,
                                        const ReloadRequest& request, config::Problems& problems);
  /// Loads the tried library, and replaces the component.
  void make_here(detail::ComponentCore& component, const nlohmann::json& order,
                 LifeChanges::Done done);
  [[nodiscard]] std::filesystem::path find(const std::string& library,
                                           config::Problems& problems) const;
  [[nodiscard]] bool is_followed(const detail::ComponentCore& component) const;
  [[nodiscard]] bool is_anyone_on_probation() const;
  [[nodiscard]] BreachCounts breaches_of(const std::string& component) const;

  ApplicationHost& application_;
  const Wiring& wiring_;
  const Chains& chains_;
  LifeChanges& life_changes_;
  std::vector<std::filesystem::path> library_path_;
  LibraryVersions versions_;

  base::PriorityMutex mutex_;
  bool is_over_ = false;
  bool is_trying_ = false;
  std::thread trial_;
  std::map<std::string, BreachCounts>
      breach_counts_;  ///< The last counts, of components on probation.
};

}  // namespace fastcycle::host
