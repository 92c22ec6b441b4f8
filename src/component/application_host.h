#pragma once

#include <string>
#include <string_view>

#include "base/clock.h"
#include "base/log.h"
#include "component/component_host.h"

namespace fastcycle::host {

class Peers;

/// Interface of the application to its parts: life cycle, modes, chains, changes of parameters.
/// `ComponentHost` is that to its components.
///
/// @threads  Safe from the start to the end.
class ApplicationHost : public ComponentHost {
 public:
  // Constant once it is built.
  [[nodiscard]] virtual const Components& components() const = 0;
  [[nodiscard]] virtual bool is_built() const = 0;
  /// Whether a recording is published in place of components.
  [[nodiscard]] virtual bool is_replay() const = 0;
  /// Whether `component` does not run here: a recording is published in its place, or nothing is,
  /// or it runs in another process.
  [[nodiscard]] virtual bool is_replayed(const std::string& component) const = 0;

  /// The application's other processes; null where it has only this one.
  [[nodiscard]] virtual Peers* peers() const = 0;

  [[nodiscard]] virtual const base::Clock& clock() const = 0;
  /// The log of FastCycle itself.
  [[nodiscard]] virtual detail::LogSource& own_log() = 0;
  /// Whether the run ends although there is input: something failed, or the end was requested.
  [[nodiscard]] virtual bool is_to_end() const = 0;

  /// In simulated time between two rounds.
  virtual void mode_changed() = 0;

  /// In a replay: makes `component` apply the recorded changes of a transaction, in its activation
  /// by that cause. `text` is a JSON object of values by name.
  ///
  /// @errors  Values that do not fit go to `problems`, and are left out.
  virtual void put_recorded_params(detail::ComponentCore& component, std::uint64_t transaction,
                                   const std::string& text, config::Problems& problems) = 0;
  /// The same, before `component` is reconstructed: the new object begins with them. `text` is that
  /// of a read `kMadeWith`.
  virtual void commit_recorded_params(detail::ComponentCore& component, const std::string& text,
                                      config::Problems& problems) = 0;

  void log(LogLevel level, std::string_view component, std::string_view text) {
    own_log().write(level, component, text);
  }

 protected:
  ~ApplicationHost() = default;
};

}  // namespace fastcycle::host
