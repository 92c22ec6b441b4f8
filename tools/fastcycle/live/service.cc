#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <google/protobuf/message.h>

#include "archive/message_text.h"
#include "archive/message_type.h"
#include "command.h"
#include "duration.h"
#include "live/message.h"
#include "live/session.h"
#include "live/text.h"
#include "option_values.h"

namespace fastcycle::tool {
namespace live {
namespace {

struct CallOptions {
  Target target;
  std::string service;
  std::string json = "{}";
  std::string timeout = "5s";
};

std::string joined(const google::protobuf::RepeatedPtrField<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text.empty() ? "-" : text;
}

int list_services(const Target& target) {
  Session session(target, "service list");
  const protocol::Overview overview = session.overview();
  std::vector<std::vector<std::string>> rows{
      {"service", "request", "reply", "feedback", "given by", "called by"}};
  Json json = Json::array();
  for (const protocol::Service& service : overview.services()) {
    rows.push_back({service.name(), service.request_type(), service.reply_type(),
                    service.feedback_type().empty() ? "-" : service.feedback_type(),
                    service.component(), joined(service.clients())});
    json.push_back(json_of(service));
  }
  if (target.is_json) {
    return print_json(json);
  }
  return print_text(rows.size() > 1 ? table_text(rows) : "The application has no services.\n");
}

protocol::Service service_called(Session& session, const std::string& name) {
  std::vector<std::string> names;
  const protocol::Overview overview = session.overview();
  for (const protocol::Service& service : overview.services()) {
    names.push_back(service.name());
  }
  require_known(name, names, "service");
  protocol::Request request;
  request.mutable_topic()->set_topic(name);
  return session.client().ask(std::move(request)).topic().service();
}

archive::MessageType type_of(const std::string& name, const std::string& schema) {
  return archive::MessageType({.id = 1, .name = name, .encoding = "protobuf", .data = schema});
}

int call(const CallOptions& options) {
  Session session(options.target, "service call");
  const protocol::Service service = service_called(session, options.service);
  const auto patience =
      std::chrono::ceil<std::chrono::milliseconds>(*parse_duration(options.timeout));
  protocol::Request request;
  protocol::CallService& call = *request.mutable_call_service();
  call.set_service(options.service);
  call.set_request(serialized_from_json(type_of(service.request_type(), service.request_schema()),
                                        options.json));
  call.set_timeout_ms(patience.count());
  const protocol::Answer answer =
      session.client().ask(std::move(request), patience + inspect::Client::kPatience);
  const protocol::Reply& reply = answer.reply();
  if (reply.status() != "ok") {
    throw Failure(kFailed, options.service + " answered: " + reply.status() +
                               (reply.error().empty() ? "" : ": ") +
                               archive::printable(reply.error()));
  }
  const archive::MessageType type = type_of(service.reply_type(), service.reply_schema());
  const auto message = type.parse(mcap::bytes_of(reply.reply()));
  if (options.target.is_json) {
    return print_json(
        {{"service", options.service},
         {"status", reply.status()},
         {"reply", Json::parse(archive::to_json(*message, archive::TextLimits::none()).data)}});
  }
  const std::string text = archive::to_text(*message);
  return print_text(text.empty() ? "ok, with an empty " + service.reply_type() + "\n" : text);
}

Command add_list_of_services(CLI::App& group) {
  CLI::App* line = group.add_subcommand("list", "List services and actions");
  line->footer(
      examples("  fastcycle service list\n"
               "  fastcycle service list --json | jq '.[].name'\n"));
  const auto target = std::make_shared<Target>();
  target->add_to(*line);
  return {line,
          [target] { return guarded("service list", [&] { return list_services(*target); }); }};
}

Command add_call(CLI::App& group) {
  CLI::App* line = group.add_subcommand("call", "Send a request to a service, and print its reply");
  line->footer(
      examples("  fastcycle service call planner/replan '{\"reason\": \"test\"}'\n"
               "  fastcycle service call planner/replan --timeout 30s --json | jq .reply\n"
               "\n"
               "Without REQUEST, an empty request is sent. The application must allow it:\n"
               "\"inspect\": {\"allow\": [\"publish\"]}.\n"));
  const auto options = std::make_shared<CallOptions>();
  line->add_option("service", options->service, "The service")->required()->type_name("SERVICE");
  line->add_option("request", options->json, "The request, as JSON")->type_name("JSON");
  line->add_option("--timeout", options->timeout, "Time limit (5s, at most 60s)")
      ->check(is_time())
      ->type_name("TIME");
  options->target.add_to(*line);
  return {line, [options] { return guarded("service call", [&] { return call(*options); }); }};
}

}  // namespace
}  // namespace live

Command add_service(CLI::App& program) {
  CLI::App* group =
      program.add_subcommand("service", "List or call the services of a running application");
  group->require_subcommand(0, 1);
  group->footer(
      examples("  fastcycle service list\n"
               "  fastcycle service call planner/replan '{\"reason\": \"test\"}'\n"));
  return {.line = group, .words = {live::add_list_of_services(*group), live::add_call(*group)}};
}

}  // namespace fastcycle::tool
