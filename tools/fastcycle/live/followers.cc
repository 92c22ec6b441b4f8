#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "archive/message_text.h"
#include "command.h"
#include "live/session.h"
#include "live/text.h"

namespace fastcycle::tool {
namespace live {
namespace {

constexpr const char* kFollowers = "followers";

/// The reports of the processes of one kind that follow others.
Json followers_of(Session& session, const std::string& kind) {
  Json found = Json::array();
  const auto& documents = session.client().welcome().documents();
  if (std::ranges::find(documents, kFollowers) == documents.end()) {
    return found;  // It has one process.
  }
  protocol::Request request;
  request.mutable_document()->set_name(kFollowers);
  const std::string text = session.client().ask(std::move(request)).document().json();
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains(kFollowers)) {
    throw Failure(kFailed, "the application sent an unreadable reply about them");
  }
  for (const Json& one : json[kFollowers]) {
    if (one.is_object() && one.value("kind", "") == kind) {
      found.push_back(one);
    }
  }
  return found;
}

std::string field_text(const Json& json, const char* key) {
  return archive::printable(json.value(key, std::string("?")));
}

std::string count_in(const Json& json, const char* key) {
  return fmt::format("{}", json.value(key, std::uint64_t{0}));
}

int show_standbys(const Target& target) {
  Session session(target, "standby");
  const Json all = followers_of(session, "standby");
  if (target.is_json) {
    return print_json(all);
  }
  if (all.empty()) {
    return print_text(
        "No process of the application has a standby; \"standby\": true of a component or process "
        "adds one.\n");
  }
  std::vector<std::vector<std::string>> rows{
      {"process", "run", "state", "activations", "behind", "compared"}};
  for (const Json& one : all) {
    rows.push_back({field_text(one, "process"), count_in(one, "run"), field_text(one, "state"),
                    count_in(one, "activations"), count_in(one, "behind"),
                    count_in(one, "compared")});
  }
  return print_text(table_text(rows));
}

std::string fields_text(const Json& topic) {
  constexpr std::size_t kMost = 12;
  std::vector<std::vector<std::string>> rows{{"field", "messages", "mean", "max", "first"}};
  const Json fields = topic.value("fields", Json::array());
  for (const Json& field : fields) {
    if (rows.size() > kMost) {
      break;
    }
    const auto number = [&](const char* key) {
      const auto found = field.find(key);
      return found != field.end() && found->is_number()
                 ? fmt::format("{:.4g}", found->get<double>())
                 : std::string();
    };
    const Json first = field.value("first", Json::object());
    rows.push_back({field_text(field, "field"), count_in(field, "messages"), number("mean"),
                    number("max"),
                    fmt::format("message {}: {} -> {}", count_in(first, "sequence"),
                                field_text(first, "recorded"), field_text(first, "now"))});
  }
  return rows.size() == 1 ? std::string() : table_text(rows, "    ");
}

std::string shadow_text(const Json& shadow) {
  std::string text =
      fmt::format("{} of {}: {}, {} activations, {} behind\n", field_text(shadow, "process"),
                  field_text(shadow, "of"), field_text(shadow, "state"),
                  count_in(shadow, "activations"), count_in(shadow, "behind"));
  for (const Json& topic : shadow.value("topics", Json::array())) {
    text += fmt::format("  {}: {} compared, {} different, {} missing, {} new{}\n",
                        field_text(topic, "topic"), count_in(topic, "compared"),
                        count_in(topic, "different"), count_in(topic, "missing"),
                        count_in(topic, "new"),
                        topic.contains("not_compared")
                            ? fmt::format(", {} not compared", count_in(topic, "not_compared"))
                            : std::string());
    text += fields_text(topic);
  }
  return text;
}

int show_shadows(const Target& target) {
  Session session(target, "shadow");
  const Json all = followers_of(session, "shadow");
  if (target.is_json) {
    return print_json(all);
  }
  std::string text;
  for (const Json& shadow : all) {
    text += (text.empty() ? "" : "\n") + shadow_text(shadow);
  }
  return print_text(
      text.empty()
          ? "The application has no shadows; \"shadow\" in its file or in an overlay adds them.\n"
          : text);
}

}  // namespace
}  // namespace live

Command add_standby(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "standby", "Show the standbys of processes: whether each is in step, and its lag");
  line->footer(
      examples("  fastcycle standby\n"
               "  fastcycle standby --json | jq '.[] | select(.state != \"in step\")'\n"
               "  fastcycle component switch planner\n"
               "\n"
               "behind: activations of the other process that are received and not yet executed.\n"
               "compared: messages that both processes have published and that are equal.\n"));
  const auto target = std::make_shared<live::Target>();
  target->add_to(*line);
  return {line, [target] {
            return live::guarded("standby", [&] { return live::show_standbys(*target); });
          }};
}

Command add_shadow(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "shadow", "Show how the messages of shadows differ from those of the components they follow");
  line->footer(examples(
      "  fastcycle shadow\n"
      "  fastcycle shadow --json | jq '.[].topics[] | select(.different > 0).fields'\n"
      "\n"
      "A shadow repeats the activations of a component with another library or other params:\n"
      "  \"shadow\": [{\"of\": \"planner\", \"library\": \"planner_v2\"}]\n"));
  const auto target = std::make_shared<live::Target>();
  target->add_to(*line);
  return {line, [target] {
            return live::guarded("shadow", [&] { return live::show_shadows(*target); });
          }};
}

}  // namespace fastcycle::tool
