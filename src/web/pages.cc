#include "web/pages.h"

#include <memory>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

namespace fastcycle::web {
namespace {

namespace protocol = inspect::protocol;

constexpr int kBadRequest = 400;

bool has_many_answers(const protocol::Request& request) {
  return request.has_stream() || request.has_stream_log() || request.has_record() ||
         request.has_end_stream() || request.has_hello();
}

}  // namespace

void Pages::ask(std::string_view body) {
  protocol::Request request;
  const auto status =
      google::protobuf::util::JsonStringToMessage({body.data(), body.size()}, &request);
  if (!status.ok()) {
    give_({.status = kBadRequest,
           .body = fmt::format("the body has to be a Request of inspect.proto as JSON: {}\n",
                               std::string(status.message()))});
    return;
  }
  if (request.what_case() == protocol::Request::WHAT_NOT_SET || has_many_answers(request)) {
    give_({.status = kBadRequest,
           .body = "the request has to ask for one answer, as {\"overview\": {}}\n"});
    return;
  }
  if (request.has_change_params()) {
    hub_.params_have_changed();
  }
  hub_.ask(*this, std::move(request), [this](const protocol::Answer& answer) {
    google::protobuf::util::JsonPrintOptions options;
    options.always_print_primitive_fields = true;
    options.preserve_proto_field_names = true;
    Page page{.type = "application/json", .body = {}};
    if (!google::protobuf::util::MessageToJsonString(answer, &page.body, options).ok()) {
      page = {.status = 500, .body = "the answer is no JSON\n"};
    }
    give_(std::move(page));
  });
}

void Pages::ask_metrics(MetricsFormat format, ServedCounts served) {
  // Both are requested at once; the answers come in this order.
  const auto chains = std::make_shared<nlohmann::json>();
  protocol::Request document;
  document.mutable_document()->set_name("chains");
  hub_.ask(*this, std::move(document), [chains](const protocol::Answer& answer) {
    if (answer.has_document()) {
      *chains = nlohmann::json::parse(answer.document().json(), nullptr, false);
    }
  });
  protocol::Request overview;
  overview.mutable_overview()->set_with_buckets(true);
  served.messages_left_out = hub_.left_out();
  hub_.ask(*this, std::move(overview), [=, this](const protocol::Answer& answer) {
    give_({.type = std::string(content_type(format)),
           .body = to_metrics(answer.overview(), *chains, served, format)});
  });
}

}  // namespace fastcycle::web
