#include "inspect_options.h"

namespace fastcycle::tool {

void InspectOptions::add_to(CLI::App& line) {
  line.add_flag("--inspect", is_asked, "Let your tools inspect the run: fastcycle top, topic, ...");
  line.add_option("--inspect-allow", allow,
                  "Changes that tools may make: params, publish, lifecycle, reload (repeatable, or "
                  "with commas)")
      ->delimiter(',')
      ->type_name("WORD");
}

std::string InspectOptions::find_wrong(const config::ApplicationDescription& application,
                                       bool is_live) const {
  for (const std::string& word : allow) {
    if (word != "params" && word != "publish" && word != "lifecycle" && word != "reload") {
      return "--inspect-allow expects params, publish, lifecycle or reload, not \"" + word + "\"";
    }
  }
  if (!allow.empty() && !is_wanted(application) && !is_live) {
    return "--inspect-allow requires --inspect or --live";
  }
  return {};
}

config::InspectDescription InspectOptions::describe(
    const config::ApplicationDescription& application) const {
  config::InspectDescription description =
      application.inspect.value_or(config::InspectDescription{});
  if (!application.inspect) {
    description.place.file = is_asked ? "--inspect" : "the command line";
  }
  for (const std::string& word : allow) {
    description.allows_params |= word == "params";
    description.allows_publish |= word == "publish";
    description.allows_lifecycle |= word == "lifecycle";
    description.allows_reload |= word == "reload";
  }
  return description;
}

}  // namespace fastcycle::tool
