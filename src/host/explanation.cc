#include "host/explanation.h"

#include <string>
#include <thread>

#include <fmt/format.h>
#include <sys/utsname.h>

#include "config/print.h"
#include "fastcycle/version.h"

namespace fastcycle::host {

record::Explanation explain(const config::ApplicationDescription& description,
                            const base::Clock& clock) {
  record::Explanation explanation;
  auto& facts = explanation.facts;
  facts["application"] = description.name;
  facts["file"] = description.file.string();
  facts["fastcycle"] = FASTCYCLE_VERSION;
  facts["clock"] = clock.is_simulated() ? "simulated" : "live";
  facts["start_ns"] = std::to_string(base::to_ns(clock.now()));
  utsname machine{};
  if (uname(&machine) == 0) {
    facts["host"] = machine.nodename;
    facts["system"] = fmt::format("{} {} {}", machine.sysname, machine.release, machine.machine);
  }
  facts["cpus"] = std::to_string(std::thread::hardware_concurrency());
  std::size_t number = 0;
  for (const config::ComponentDescription& component : description.components) {
    facts[fmt::format("component.{}", number++)] = component.name;
  }
  explanation.application = config::print(description.effective);
  return explanation;
}

}  // namespace fastcycle::host
