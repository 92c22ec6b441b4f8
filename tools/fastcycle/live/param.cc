#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fnmatch.h>

#include "archive/message_text.h"
#include "base/printable.h"
#include "command.h"
#include "config/nearest.h"
#include "config/problem.h"
#include "live/session.h"
#include "live/text.h"
#include "report/param_list.h"

namespace fastcycle::tool {
namespace live {
namespace {

struct ParamOptions {
  Target target;
  std::vector<std::string> words;  ///< Patterns, names, or NAME=VALUE.
};

Json parsed(const std::string& json) {
  return json.empty() ? Json() : Json::parse(json, nullptr, false);
}

host::ListedParam listed(const protocol::Param& param) {
  return {.component = param.component(),
          .name = param.name(),
          .type = param.type(),
          .unit = param.unit(),
          .min = parsed(param.min_json()),
          .max = parsed(param.max_json()),
          .names = {param.names().begin(), param.names().end()},
          .has_fallback = !param.default_json().empty(),
          .fallback = parsed(param.default_json()),
          .value = parsed(param.value_json()),
          .origin = param.origin(),
          .place = {.file = param.place(), .line = 0, .pointer = {}},
          .is_tunable = param.is_tunable(),
          .description = param.description()};
}

std::vector<host::ListedParam> params_of(Session& session) {
  protocol::Request request;
  request.mutable_params();
  const protocol::Answer answer = session.client().ask(std::move(request));
  std::vector<host::ListedParam> params;
  for (const protocol::Param& param : answer.params().params()) {
    params.push_back(listed(param));
  }
  return params;
}

/// "limiter" means all of that component, "*.limit_mps" one of each.
bool is_meant(const std::string& pattern, const host::ListedParam& param) {
  return fnmatch(pattern.c_str(), param.component.c_str(), 0) == 0 ||
         fnmatch(pattern.c_str(), param.full_name().c_str(), 0) == 0;
}

std::vector<std::string> names_of(const std::vector<host::ListedParam>& params) {
  std::vector<std::string> names;
  for (const host::ListedParam& param : params) {
    names.push_back(param.full_name());
  }
  return names;
}

int list(const ParamOptions& options) {
  Session session(options.target, "param list");
  std::vector<host::ListedParam> params = params_of(session);
  for (const std::string& pattern : options.words) {
    if (std::ranges::none_of(params, [&](const auto& param) { return is_meant(pattern, param); })) {
      std::vector<std::string> known = names_of(params);
      for (const host::ListedParam& param : params) {
        known.push_back(param.component);
      }
      require_known(pattern, known, "component or param");
    }
  }
  std::erase_if(params, [&](const host::ListedParam& param) {
    return !options.words.empty() &&
           std::ranges::none_of(
               options.words, [&](const std::string& pattern) { return is_meant(pattern, param); });
  });
  if (options.target.is_json) {
    return print_text(base::printable_json(host::to_json(params)));
  }
  return print_text(params.empty() ? "The components have no params.\n" : host::to_table(params));
}

// ---- Values ----

std::string value_text(const Json& value) {
  return value.is_string() ? value.get<std::string>()
                           : value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

const host::ListedParam& find(const std::vector<host::ListedParam>& params,
                              const std::string& name) {
  require_known(name, names_of(params), "param");
  return *std::ranges::find_if(params,
                               [&](const auto& param) { return param.full_name() == name; });
}

int get(const ParamOptions& options) {
  Session session(options.target, "param get");
  const std::vector<host::ListedParam> params = params_of(session);
  Json json = Json::object();
  std::string text;
  for (const std::string& name : options.words) {
    const host::ListedParam& param = find(params, name);
    json[name] = param.value;
    const std::string value =
        archive::printable(value_text(param.value)) + (param.unit.empty() ? "" : " " + param.unit);
    text += (options.words.size() == 1 ? value : name + " = " + value) + "\n";
  }
  return options.target.is_json ? print_json(json) : print_text(text);
}

/// NAME=VALUE; a value that is no JSON is a text.
protocol::ChangeParams::Change change_of(const std::string& word) {
  const std::size_t equals = word.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw Failure(kWrong,
                  "expects COMPONENT.PARAM=VALUE, not \"" + archive::printable(word) + "\"");
  }
  const std::string value = word.substr(equals + 1);
  protocol::ChangeParams::Change change;
  change.set_param(word.substr(0, equals));
  change.set_value_json(Json::accept(value)
                            ? value
                            : Json(value).dump(-1, ' ', false, Json::error_handler_t::replace));
  return change;
}

/// Throws a `Failure` with the errors of the changes, one a line.
[[noreturn]] void refuse(const protocol::ParamsChanged& changed) {
  std::string text = "nothing was changed";
  for (const std::string& error : changed.errors()) {
    text += "\n  " + archive::printable(error);
  }
  throw Failure(kFailed, text);
}

int set(const ParamOptions& options) {
  protocol::Request request;
  for (const std::string& word : options.words) {
    *request.mutable_change_params()->add_changes() = change_of(word);
  }
  Session session(options.target, "param set");
  const std::vector<host::ListedParam> before = params_of(session);
  const protocol::ChangeParams changes = request.change_params();
  for (const protocol::ChangeParams::Change& change : changes.changes()) {
    if (!change.param().starts_with("shared_params.")) {
      find(before, change.param());
    }
  }
  const protocol::Answer answer = session.client().ask(std::move(request));
  if (answer.params_changed().errors_size() > 0) {
    refuse(answer.params_changed());
  }
  Json json = Json::object();
  std::string text;
  for (const protocol::ChangeParams::Change& change : changes.changes()) {
    const Json value = parsed(change.value_json());
    json[change.param()] = value;
    text += change.param() + " = " + archive::printable(value_text(value));
    if (!change.param().starts_with("shared_params.")) {
      text += " (was " + archive::printable(value_text(find(before, change.param()).value)) + ")";
    }
    text += "\n";
  }
  return options.target.is_json ? print_json(json) : print_text(text);
}

Command add_list_of_params(CLI::App& group) {
  CLI::App* line = group.add_subcommand("list", "List params with their values");
  line->footer(
      examples("  fastcycle param list\n"
               "  fastcycle param list limiter '*.limit_mps'\n"
               "  fastcycle param list --json | jq '.[] | select(.tunable).name'\n"));
  const auto options = std::make_shared<ParamOptions>();
  line->add_option("patterns", options->words,
                   "Only these components, or params as limiter.limit_mps; * matches any text")
      ->type_name("PATTERN");
  options->target.add_to(*line);
  return {line, [options] { return guarded("param list", [&] { return list(*options); }); }};
}

Command add_get(CLI::App& group) {
  CLI::App* line = group.add_subcommand("get", "Print the values of params");
  line->footer(
      examples("  fastcycle param get limiter.limit_mps\n"
               "  fastcycle param get limiter.limit_mps planner.horizon_s --json\n"));
  const auto options = std::make_shared<ParamOptions>();
  line->add_option("params", options->words, "The params")
      ->required()
      ->type_name("COMPONENT.PARAM");
  options->target.add_to(*line);
  return {line, [options] { return guarded("param get", [&] { return get(*options); }); }};
}

Command add_set(CLI::App& group) {
  CLI::App* line = group.add_subcommand("set", "Change params that are tunable");
  line->footer(
      examples("  fastcycle param set limiter.limit_mps=20\n"
               "  fastcycle param set limiter.limit_mps=20 limiter.jerk_mps3=1.5\n"
               "  fastcycle param set shared_params.vehicle_mass_kg=1650\n"
               "\n"
               "Several params form one transaction: all are changed, or none. The application\n"
               "must allow it: \"inspect\": {\"allow\": [\"params\"]}.\n"));
  const auto options = std::make_shared<ParamOptions>();
  line->add_option("changes", options->words, "The new values, as JSON; other text is a string")
      ->required()
      ->type_name("COMPONENT.PARAM=VALUE");
  options->target.add_to(*line);
  return {line, [options] { return guarded("param set", [&] { return set(*options); }); }};
}

}  // namespace
}  // namespace live

Command add_param(CLI::App& program) {
  CLI::App* group =
      program.add_subcommand("param", "Read and change the params of a running application");
  group->require_subcommand(0, 1);
  group->footer(examples(
      "  fastcycle param list limiter\n"
      "  fastcycle param get limiter.limit_mps\n"
      "  fastcycle param set limiter.limit_mps=20\n"
      "\n"
      "fastcycle params app.json lists the params of an application without running it.\n"));
  return {
      .line = group,
      .words = {live::add_list_of_params(*group), live::add_get(*group), live::add_set(*group)}};
}

}  // namespace fastcycle::tool
