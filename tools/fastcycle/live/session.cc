#include "live/session.h"

#include <algorithm>
#include <cstdio>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <poll.h>
#include <sched.h>
#include <unistd.h>

#include "archive/message_text.h"
#include "base/printable.h"
#include "config/nearest.h"
#include "config/problem.h"
#include "mcap/topic_filter.h"
#include "print.h"

namespace fastcycle::tool::live {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

constexpr std::chrono::milliseconds kPatience{50};
constexpr std::chrono::seconds kDrain{5};

/// From now on this thread runs only on an idle CPU, so that an observer delays nothing else.
void give_way() {
  const sched_param none{};
  static_cast<void>(::sched_setscheduler(0, SCHED_IDLE, &none));  // Lower is always allowed.
}

/// Whether standard output still has a reader.
bool has_reader() {
  pollfd output{.fd = STDOUT_FILENO, .events = 0, .revents = 0};
  return poll(&output, 1, 0) <= 0 || (output.revents & POLLERR) == 0;
}

Json scalar(const pb::Message& message, const Field& field, int index) {
  const pb::Reflection& reflection = *message.GetReflection();
  const auto value = [&](auto one, auto element) {
    return Json(index < 0 ? (reflection.*one)(message, &field)
                          : (reflection.*element)(message, &field, index));
  };
  using Reflection = pb::Reflection;
  switch (field.cpp_type()) {
    case Field::CPPTYPE_INT32:
      return value(&Reflection::GetInt32, &Reflection::GetRepeatedInt32);
    case Field::CPPTYPE_INT64:
      return value(&Reflection::GetInt64, &Reflection::GetRepeatedInt64);
    case Field::CPPTYPE_UINT32:
      return value(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32);
    case Field::CPPTYPE_UINT64:
      return value(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64);
    case Field::CPPTYPE_DOUBLE:
      return value(&Reflection::GetDouble, &Reflection::GetRepeatedDouble);
    case Field::CPPTYPE_FLOAT:
      return value(&Reflection::GetFloat, &Reflection::GetRepeatedFloat);
    case Field::CPPTYPE_BOOL:
      return value(&Reflection::GetBool, &Reflection::GetRepeatedBool);
    case Field::CPPTYPE_MESSAGE:
      return json_of(index < 0 ? reflection.GetMessage(message, &field)
                               : reflection.GetRepeatedMessage(message, &field, index));
    default:
      return archive::scalar_text(message, field, index);
  }
}

/// Parses a text as JSON; null if it is empty.
Json parse_or_null(const std::string& text) {
  const Json json = Json::parse(text, nullptr, false);
  return json.is_discarded() ? Json() : json;
}

}  // namespace

// ---- Requests ----

void Target::add_application_to(CLI::App& line) {
  line.add_option("--app", application, "The running application (the only one)")
      ->type_name("NAME");
}

void Target::add_to(CLI::App& line, const std::string& json_help) {
  add_application_to(line);
  line.add_flag("--json", is_json, json_help);
}

void require_live_only(const CLI::App& line, const std::vector<std::string>& allowed) {
  for (const CLI::Option* option : line.get_options()) {
    if (option->count() == 0 || option->get_single_name() == "live") {
      continue;
    }
    if (option->get_positional()) {
      throw Failure(kWrong, "--live inspects a running application; give --app NAME, not a file");
    }
    if (std::ranges::find(allowed, option->get_single_name()) == allowed.end()) {
      throw Failure(kWrong, "--" + option->get_single_name() + " cannot be used with --live");
    }
  }
}

void require_file(const CLI::App& line) {
  if (line.count("--app") > 0) {
    throw Failure(kWrong, "--app requires --live");
  }
  if (line.count("application") == 0) {
    throw Failure(
        kWrong,
        "application is required: the application's JSON file, or --live for a running one");
  }
}

int guarded(const std::string& command, const std::function<int()>& body) {
  const auto report = [&](const std::string& sentence) {
    print_to(stderr, "fastcycle {}: {}\n", command, sentence);
  };
  try {
    return body();
  } catch (const Failure& failure) {
    report(failure.what());
    return failure.exit_code();
  } catch (const inspect::ClientError& error) {
    std::string sentence = archive::printable(error.what());
    if (!error.hint().empty()) {
      sentence += "; " + archive::printable(error.hint());
    }
    report(sentence);
    return kFailed;
  }
}

Session::Session(const Target& target, const std::string& command)
    : client_(inspect::find_application(target.application).socket, "fastcycle " + command) {}

protocol::Overview Session::overview() {
  protocol::Request request;
  request.mutable_overview();
  protocol::Answer answer = client_.ask(std::move(request));
  return std::move(*answer.mutable_overview());
}

protocol::Topic Session::topic(const std::string& name) {
  require_known(name, names_of_topics(overview(), true), "topic");
  protocol::Request request;
  request.mutable_topic()->set_topic(name);
  protocol::Answer answer = client_.ask(std::move(request));
  return std::move(*answer.mutable_topic());
}

// ---- Streams ----

Streams::Streams(Session& session)
    : client_(session.client()),
      signals_(block_stop_signals()),
      stop_signals_(signals_, [this] { is_stopped_ = true; }) {}

protocol::Started Streams::begin(protocol::Request request, std::uint32_t* id) {
  protocol::Answer answer = client_.begin(std::move(request));
  running_.push_back(answer.id());
  if (id != nullptr) {
    *id = answer.id();
  }
  return std::move(*answer.mutable_started());
}

void Streams::end_all() {
  for (const std::uint32_t stream : running_) {
    client_.end(stream);
  }
}

void Streams::follow(Output& output, const std::function<bool(const protocol::Answer*)>& give,
                     bool drains) {
  if (!drains) {
    give_way();
  }
  std::optional<std::chrono::steady_clock::time_point> stopped;
  while (!running_.empty()) {
    if (is_stopped_ && !stopped) {
      if (!drains) {
        return;
      }
      stopped = std::chrono::steady_clock::now();
      end_all();
    }
    if (stopped && std::chrono::steady_clock::now() - *stopped > kDrain) {
      throw Failure(kFailed, "the application did not end the stream");
    }
    const std::optional<protocol::Answer> answer = client_.next(kPatience);
    if (answer && answer->has_ended()) {
      std::erase(running_, answer->id());
      if (running_.empty() && !stopped) {
        print_to(stderr, "fastcycle: {}\n", archive::printable(answer->ended().why()));
      }
    }
    if (!give(answer ? &*answer : nullptr) || !output.flush() || !has_reader()) {
      return;
    }
  }
}

// ---- JSON ----

Json json_of(const pb::Message& message) {
  constexpr std::string_view kJson = "_json";
  Json json = Json::object();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const Field& field = *message.GetDescriptor()->field(i);
    std::string name = field.name();
    if (field.type() == Field::TYPE_BYTES) {
      continue;
    }
    if (field.is_repeated()) {
      Json& list = json[name] = Json::array();
      for (int k = 0; k < message.GetReflection()->FieldSize(message, &field); ++k) {
        list.push_back(scalar(message, field, k));
      }
      continue;
    }
    Json value = scalar(message, field, -1);
    if (name.ends_with(kJson)) {
      name.resize(name.size() - kJson.size());
      value = parse_or_null(value.get<std::string>());
    }
    json[name] = std::move(value);
  }
  return json;
}

std::string json_line(const Json& json) {
  return base::printable_json(json.dump(-1, ' ', false, Json::error_handler_t::replace)) + "\n";
}

int print_json(const Json& json) {
  return print_text(base::printable_json(json.dump(2, ' ', false, Json::error_handler_t::replace)) +
                    "\n");
}

int print_text(const std::string& text) {
  Output output;
  if (output.write(text)) {
    output.flush();
  }
  return kDone;
}

// ---- Names ----

void require_known(const std::string& name, const std::vector<std::string>& known,
                   const std::string& what) {
  if (std::ranges::find(known, name) != known.end()) {
    return;
  }
  const std::string hint = config::did_you_mean(config::nearest(name, known));
  throw Failure(kWrong, "there is no " + what + " \"" + archive::printable(name) + "\"" +
                            (hint.empty() ? "" : "; " + hint));
}

std::vector<std::string> choose(const std::vector<std::string>& known,
                                const std::vector<std::string>& patterns, const std::string& what) {
  for (const std::string& pattern : patterns) {
    if (std::ranges::none_of(known,
                             [&](const auto& name) { return mcap::matches(pattern, name); })) {
      require_known(pattern, known, what);
    }
  }
  const mcap::TopicFilter filter{.topics = patterns, .except = {}};
  std::vector<std::string> chosen;
  std::ranges::copy_if(known, std::back_inserter(chosen),
                       [&](const std::string& name) { return filter.wants(name); });
  return chosen;
}

std::vector<std::string> names_of_topics(const protocol::Overview& overview, bool with_services) {
  std::vector<std::string> names;
  for (const protocol::Topic& topic : overview.topics()) {
    if (with_services || !topic.is_service()) {
      names.push_back(topic.name());
    }
  }
  return names;
}

std::vector<std::string> names_of_components(const protocol::Overview& overview) {
  std::vector<std::string> names;
  for (const protocol::Component& component : overview.components()) {
    names.push_back(component.name());
  }
  return names;
}

std::uint64_t uptime_ns(const protocol::Overview& overview) {
  const bool has_started = overview.start_ns() != 0 && overview.now_ns() > overview.start_ns();
  return has_started ? static_cast<std::uint64_t>(overview.now_ns() - overview.start_ns()) : 0;
}

}  // namespace fastcycle::tool::live
