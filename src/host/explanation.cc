#include "host/explanation.h"

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <sys/utsname.h>

#include "base/build_id.h"
#include "component/component_core.h"
#include "config/print.h"
#include "fastcycle/version.h"

namespace fastcycle::host {
namespace {

/// Which builds of which libraries this process runs.
void add_builds(std::map<std::string, std::string>& facts) {
  base::for_each_build_id([&facts](const std::string& file, const std::string& build_id) {
    const std::string name = std::filesystem::path(file).filename().string();
    facts["build_id." + (name.empty() ? "program" : name)] = build_id;
  });
}

}  // namespace

record::Explanation explain(const config::ApplicationDescription& description,
                            const base::Clock& clock, const Components& components) {
  record::Explanation explanation;
  auto& facts = explanation.facts;
  facts["application"] = description.name;
  // A replay resolves relative paths from here.
  std::error_code ignored;
  facts["file"] = description.file.empty()
                      ? std::string()
                      : std::filesystem::absolute(description.file, ignored).string();
  facts["fastcycle"] = FASTCYCLE_VERSION;
  facts["clock"] = clock.is_simulated() ? "simulated" : "live";
  facts["start_ns"] = std::to_string(base::to_ns(clock.now()));
  utsname machine{};
  if (uname(&machine) == 0) {
    facts["host"] = machine.nodename;
    facts["system"] = fmt::format("{} {} {}", machine.sysname, machine.release, machine.machine);
  }
  add_builds(facts);
  facts["cpus"] = std::to_string(std::thread::hardware_concurrency());
  std::size_t number = 0;
  for (const auto& component : components) {
    facts[fmt::format("component.{}", number++)] = component->name;
  }
  explanation.application = config::print(description.effective);
  return explanation;
}

}  // namespace fastcycle::host
