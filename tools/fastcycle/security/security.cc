// fastcycle security: the participants in DDS, and their permissions.

#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command.h"
#include "config/load.h"
#include "config/problem.h"
#include "configuration.h"
#include "dds_security/documents.h"
#include "dds_security/keystore.h"
#include "option_values.h"
#include "print.h"
#include "ros2/names.h"
#include "security/rights.h"

namespace fastcycle::tool {
namespace {

constexpr std::uint32_t kDays = 3650;
constexpr double kDaysMax = 36'500;

struct InitOptions {
  std::filesystem::path folder;
  std::uint32_t days = kDays;
};

struct AddOptions {
  std::filesystem::path folder;
  std::string name;
  config::LoadOptions load;
  std::string component;
  RosRights more;
  std::uint32_t domain = 0;
  std::uint32_t days = kDays;
};

int wrong(const std::string& word, const std::string& sentence) {
  print_to(stderr, "fastcycle security {}: {}\n", word, sentence);
  return kWrong;
}

int init(const InitOptions& options) {
  try {
    dds_security::make_keystore(options.folder, dds_security::Days(options.days));
  } catch (const std::exception& error) {
    return wrong("init", error.what());
  }
  print_to(stdout,
           "{} contains a new certificate authority and the rules of secured domains.\n"
           "Anyone with {} can create participants: keep it on this machine.\n"
           "Next, for the gateway of an application:\n"
           "  fastcycle security add {} NAME app.json\n",
           options.folder.string(), (options.folder / "private/ca.key.pem").string(),
           options.folder.string());
  return flush_output();
}

/// The component that is meant; null, and a sentence, if that cannot be known.
const config::ComponentDescription* find_gateway(const config::ApplicationDescription& application,
                                                 const std::string& name, std::string& sentence) {
  std::vector<const config::ComponentDescription*> found;
  std::vector<std::string> names;
  for (const config::ComponentDescription& component : application.components) {
    if (name.empty() ? component.library == "dds_gateway" : component.name == name) {
      found.push_back(&component);
      names.push_back(component.name);
    }
  }
  if (found.size() == 1) {
    return found.front();
  }
  const std::string file = application.file.string();
  sentence = !name.empty() ? fmt::format("{} has no component \"{}\"", file, name)
             : found.empty()
                 ? fmt::format("{} has no component of the library dds_gateway", file)
                 : fmt::format("{} has several gateways: {}; select one with --component NAME",
                               file, fmt::join(names, ", "));
  return nullptr;
}

/// None if there are errors, which were printed.
std::optional<dds_security::Rights> rights_in(const AddOptions& options) {
  if (options.load.file.empty()) {
    return dds_security::Rights{.domain = options.domain, .publish = {}, .subscribe = {}};
  }
  // Only its files are checked, because the gateway itself requires the enclave to be created.
  config::Problems problems;
  const config::ApplicationDescription application = config::load(options.load, problems);
  if (problems.has_errors()) {
    (void)may_start(problems, options.load.file.string());
    return {};
  }
  std::string sentence;
  const config::ComponentDescription* const gateway =
      find_gateway(application, options.component, sentence);
  if (gateway == nullptr) {
    (void)wrong("add", sentence);
    return {};
  }
  dds_security::Rights rights = rights_of(*gateway, problems);
  if (problems.has_errors()) {
    (void)may_start(problems, options.load.file.string());
    return {};
  }
  return rights;
}

int add_participant(const AddOptions& options) {
  const std::string name = options.name.starts_with('/') ? options.name : "/" + options.name;
  if (const auto error = ros2::ros_name_error(name)) {
    return wrong("add", fmt::format("\"{}\": {}", options.name, *error));
  }
  if (const std::string error = error_of(options.more); !error.empty()) {
    return wrong("add", error);
  }
  std::optional<dds_security::Rights> rights = rights_in(options);
  if (!rights) {
    return kWrong;
  }
  add(options.more, *rights);
  std::filesystem::path enclave;
  try {
    enclave =
        dds_security::add_enclave(options.folder, name, *rights, dds_security::Days(options.days));
  } catch (const std::exception& error) {
    return wrong("add", error.what());
  }
  print_to(stdout,
           "{} may, in the domain {}:\n"
           "  publish    {}\n"
           "  subscribe  {}\n"
           "Its files are in {}\n"
           "  of a gateway, in its params:  \"security\": \"{}\"\n"
           "  of a node of ROS 2:           ROS_SECURITY_KEYSTORE={} ROS_SECURITY_ENABLE=true "
           "ROS_SECURITY_STRATEGY=Enforce, and --ros-args --enclave {}\n",
           name, rights->domain, fmt::join(rights->publish, " "), fmt::join(rights->subscribe, " "),
           enclave.string(), enclave.string(),
           std::filesystem::absolute(options.folder).lexically_normal().string(), name);
  return flush_output();
}

void add_days(CLI::App& line, std::uint32_t& days) {
  line.add_option("--days", days, "Validity in days (3650)")
      ->type_name("N")
      ->check(is_number_from(1, kDaysMax));
}

Command add_init(CLI::App& group) {
  CLI::App* line =
      group.add_subcommand("init", "Create a keystore: a certificate authority for participants");
  line->footer(
      examples("  fastcycle security init keys\n"
               "\n"
               "It has the layout of a ROS 2 keystore, which its README describes. Existing files\n"
               "are never changed.\n"));
  const auto options = std::make_shared<InitOptions>();
  line->add_option("folder", options->folder, "The folder to create")->required()->type_name("DIR");
  add_days(*line, options->days);
  return {line, [options] { return init(*options); }};
}

template <typename T>
CLI::Option* add_repeatable(CLI::App& line, const char* name, std::vector<T>& values,
                            const char* type, const char* text) {
  return line.add_option(name, values, text)->allow_extra_args(false)->type_name(type);
}

Command add_add(CLI::App& group) {
  CLI::App* line = group.add_subcommand(
      "add", "Add a participant to a keystore: its certificate, its key, its permissions");
  line->footer(examples(
      "  fastcycle security add keys gateway app.json\n"
      "  fastcycle security add keys talker --node talker --publish chatter --domain 42\n"
      "\n"
      "With an application, exactly the topics in the params of its gateway are permitted,\n"
      "each in its direction and in their domain.\n"));
  const auto options = std::make_shared<AddOptions>();
  line->add_option("folder", options->folder, "The keystore")->required()->type_name("DIR");
  line->add_option("name", options->name, "Name of the participant, as gateway or car/front")
      ->required()
      ->type_name("NAME");
  CLI::Option* const application =
      line->add_option("application", options->load.file, "The application's JSON file")
          ->type_name("FILE");
  line->add_option("--component", options->component,
                   "The component that is the gateway; required if there are several")
      ->type_name("NAME")
      ->needs(application);
  add_repeatable(*line, "--overlay", options->load.overlays, "FILE",
                 "Merge this overlay into the application, in the order given. Repeatable")
      ->needs(application);
  add_repeatable(*line, "--set", options->load.sets, "C.P=VALUE",
                 "Set param P of component C. Repeatable")
      ->needs(application);
  add_repeatable(*line, "--var", options->load.variables, "NAME=VALUE",
                 "Set a variable of the application, ${NAME}. Repeatable")
      ->needs(application);
  add_repeatable(*line, "--publish", options->more.publish, "TOPIC",
                 "Permit publishing this ROS 2 topic. Repeatable");
  add_repeatable(*line, "--subscribe", options->more.subscribe, "TOPIC",
                 "Permit subscribing to this ROS 2 topic. Repeatable");
  add_repeatable(*line, "--serve", options->more.serve, "SERVICE",
                 "Permit providing this ROS 2 service. Repeatable");
  add_repeatable(*line, "--call", options->more.call, "SERVICE",
                 "Permit calling this ROS 2 service. Repeatable");
  add_repeatable(*line, "--node", options->more.nodes, "NODE",
                 "Permit the default topics of this ROS 2 node: log, params, clock. Repeatable");
  line->add_option("--domain", options->domain,
                   "The permitted domain (that of the application, else 0)")
      ->type_name("N")
      ->check(is_number_from(0, dds_security::kDomainMax))
      ->excludes(application);
  add_days(*line, options->days);
  return {line, [options] { return add_participant(*options); }};
}

}  // namespace

Command add_security(CLI::App& program) {
  CLI::App* group = program.add_subcommand(
      "security", "Manage the participants of a secured DDS domain and their permissions");
  group->require_subcommand(0, 1);
  group->footer(
      examples("  fastcycle security init keys\n"
               "  fastcycle security add keys gateway app.json\n"));
  return {.line = group, .words = {add_init(*group), add_add(*group)}};
}

}  // namespace fastcycle::tool
