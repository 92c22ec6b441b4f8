#pragma once

#include <map>
#include <string>
#include <vector>

#include "component/component_core.h"
#include "config/description.h"
#include "loading/component_classes.h"
#include "record/recording_reader.h"

namespace fastcycle::host {

/// Stand-ins for publishers of a recording that are no components of the application (FastCycle's
/// own status and log, tools, components of an earlier version), so that their messages reach
/// subscribers.
///
///     StandIns stand_ins(libraries, description, reader.streams());
///     Application application(stand_ins.description(), …);
///     application.declare_stand_in = [&](auto& core) { stand_ins.declare(core); };
///     application.build(stand_ins, problems, ConstructorFault::kFault);
///
/// @threads  Confined to the control thread.
class StandIns final : public ComponentClasses {
 public:
  /// `classes` provides the application's components; it has to outlive this.
  StandIns(ComponentClasses& classes, config::ApplicationDescription description,
           const std::vector<record::RecordedStream>& streams);

  /// Includes a component for each stand-in, after the others.
  [[nodiscard]] const config::ApplicationDescription& description() const { return description_; }

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;
  /// Declares the publishers of one of them; within its constructor. Leaves out those whose message
  /// type is in no library: they can have no subscriber.
  void declare(detail::ComponentCore& component) const;

 private:
  ComponentClasses& classes_;
  config::ApplicationDescription description_;
  std::map<std::string, std::vector<record::RecordedStream>> streams_;  ///< By component.
};

}  // namespace fastcycle::host
