#include "dds_gateway/param_services.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ros2/names.h"
#include "ros2/type_hash.h"

namespace fastcycle::dds_gateway {
namespace {

constexpr std::size_t kNamesMax = 1024;  // In one request.
constexpr std::size_t kDepth = 10;       // Requests waiting in the engine.

struct KnownService {
  const char* name;
  const char* type;
};
// In the order of `Service`.
constexpr KnownService kKnown[] = {
    {"get_parameters", "rcl_interfaces/srv/GetParameters"},
    {"get_parameter_types", "rcl_interfaces/srv/GetParameterTypes"},
    {"describe_parameters", "rcl_interfaces/srv/DescribeParameters"},
    {"list_parameters", "rcl_interfaces/srv/ListParameters"},
    {"set_parameters", "rcl_interfaces/srv/SetParameters"},
    {"set_parameters_atomically", "rcl_interfaces/srv/SetParametersAtomically"}};

/// Too many are an error, as truncated bytes are.
void refuse_many(const ros2::CdrReader& in, std::string_view field, std::size_t count) {
  if (count > kNamesMax) {
    in.fail(field, fmt::format("at most {} elements", kNamesMax), std::to_string(count));
  }
}

std::vector<std::string> read_names(ros2::CdrReader& in, std::string_view field) {
  const std::uint32_t count = in.count(field, 5);
  refuse_many(in, field, count);
  std::vector<std::string> names(count);
  for (std::string& name : names) {
    name = in.text(field);
  }
  return names;
}

bool matches(const ParamSettings& settings, std::string_view param) {
  std::string_view pattern = settings.param;
  if (!pattern.ends_with(".*")) {
    return pattern == param;
  }
  pattern.remove_suffix(1);
  return param.starts_with(pattern);
}

void write_texts(const std::vector<std::string>& texts, ros2::CdrWriter& out) {
  out.count(texts.size());
  for (const std::string& text : texts) {
    out.text(text);
  }
}

void write_result(const std::string& reason, ros2::CdrWriter& out) {
  out.boolean(reason.empty());
  out.text(reason);
}

std::string text_of(const ParamsResult& result) {
  return fmt::format("{}", fmt::join(result.errors, "; "));
}

}  // namespace

std::vector<std::string> listed_names(const std::vector<std::string>& names,
                                      const std::vector<std::string>& prefixes,
                                      std::uint64_t depth) {
  const auto is_listed = [&](std::string_view name, std::string_view prefix) {
    if (name == prefix) {
      return true;
    }
    if (!prefix.empty()) {
      if (!name.starts_with(prefix) || name.substr(prefix.size(), 1) != ".") {
        return false;
      }
      name.remove_prefix(prefix.size() + 1);
    }
    return depth == 0 || static_cast<std::uint64_t>(std::ranges::count(name, '.')) < depth;
  };
  std::vector<std::string> listed;
  std::ranges::copy_if(names, std::back_inserter(listed), [&](const std::string& name) {
    return prefixes.empty() ? is_listed(name, "")
                            : std::ranges::any_of(prefixes, [&](const std::string& prefix) {
                                return is_listed(name, prefix);
                              });
  });
  return listed;
}

ParamServices::ParamServices(Context& context, const std::string& node,
                             std::vector<ParamSettings> settings, ros2::Definitions& definitions,
                             Report report)
    : context_(context), settings_(std::move(settings)), report_(std::move(report)) {
  for (std::size_t i = 0; i < ends_.size(); ++i) {
    End& end = ends_[i];
    end.name = fmt::format("{}/{}", node, kKnown[i].name);
    end.request_type = fmt::format("{}_Request", kKnown[i].type);
    end.reply_type = fmt::format("{}_Response", kKnown[i].type);
    end.request_hash = ros2::type_hash(definitions.find(end.request_type));
    end.reply_hash = ros2::type_hash(definitions.find(end.reply_type));
  }
}

void ParamServices::open(Participant& participant, const Arrival& arrival) {
  for (std::size_t i = 0; i < ends_.size(); ++i) {
    End& end = ends_[i];
    const std::string id = participant.service_user_data(false);
    const Qos qos{.is_reliable = true, .is_transient_local = false, .depth = kDepth};
    end.reader = participant.create_reader(
        {.topic = ros2::dds_request_topic(end.name),
         .type = ros2::dds_type(end.request_type),
         .user_data = id + ros2::type_user_data(end.request_hash),
         .qos = qos,
         .is_reader = true,
         .role = Role::kRequests},
        [arrival, i](std::span<const std::byte> message, const SampleInfo& info) {
          arrival(i, info.request, message);
        });
    end.writer = participant.create_writer({.topic = ros2::dds_reply_topic(end.name),
                                            .type = ros2::dds_type(end.reply_type),
                                            .user_data = id + ros2::type_user_data(end.reply_hash),
                                            .qos = qos,
                                            .is_reader = false,
                                            .role = Role::kReplies});
  }
}

void ParamServices::close() {
  for (End& end : ends_) {
    end.reader.reset();
    end.writer.reset();
  }
}

std::uint64_t ParamServices::lost() const {
  std::uint64_t sum = 0;
  for (const End& end : ends_) {
    sum += end.reader == nullptr ? 0 : end.reader->lost();
  }
  return sum;
}

std::vector<Guid> ParamServices::readers() const {
  std::vector<Guid> guids;
  for (const End& end : ends_) {
    guids.push_back(end.reader->guid());
  }
  return guids;
}

std::vector<Guid> ParamServices::writers() const {
  std::vector<Guid> guids;
  for (const End& end : ends_) {
    guids.push_back(end.writer->guid());
  }
  return guids;
}

ParamServices::SeenByName ParamServices::seen() const {
  SeenByName seen;
  for (ParamInfo& info : list_params(context_)) {
    const auto found = std::ranges::find_if(
        settings_, [&](const ParamSettings& one) { return matches(one, info.param); });
    if (found == settings_.end()) {
      continue;
    }
    const bool may_change =
        info.is_tunable && std::ranges::any_of(settings_, [&](const ParamSettings& one) {
          return one.may_change && matches(one, info.param);
        });
    std::string name = info.param;
    seen.emplace(std::move(name), Seen{.info = std::move(info), .may_change = may_change});
  }
  return seen;
}

std::vector<std::string> ParamServices::unknown() const {
  const SeenByName all = seen();
  std::vector<std::string> names;
  for (const ParamSettings& one : settings_) {
    if (std::ranges::none_of(all, [&](const auto& param) { return matches(one, param.first); })) {
      names.push_back(one.param);
    }
  }
  return names;
}

void ParamServices::take(std::size_t service, const Identity& request,
                         std::span<const std::byte> message) {
  ++asked;
  const auto which = static_cast<Service>(service);
  try {
    ros2::CdrReader in(message, ends_.at(service).request_type);
    answer(which, request, in);
  } catch (const ros2::CdrError& error) {
    fail(which, error.what());
  }
}

void ParamServices::answer(Service service, const Identity& request, ros2::CdrReader& in) {
  if (service == kSet || service == kSetAtomically) {
    const std::vector<RosParam> params = read_params(in);
    refuse_many(in, "parameters", params.size());
    service == kSet ? set(request, params) : set_atomically(request, params);
    return;
  }
  ros2::Buffer message;
  ros2::CdrWriter out(message, ends_[service].reply_type);
  if (service == kList) {
    list(in, out);
  } else {
    const std::vector<std::string> names = read_names(in, "names");
    const SeenByName all = seen();
    out.count(names.size());
    for (const std::string& name : names) {
      // Unknown or hidden parameters are not set.
      const auto found = all.find(name);
      const bool is_seen = found != all.end();
      if (service == kGet) {
        write(is_seen ? ros_value_of(found->second.info) : RosParamValue(), out);
      } else if (service == kTypes) {
        out.number(static_cast<std::uint8_t>(is_seen ? ros_type_of(found->second.info)
                                                     : RosParamType::kNotSet));
      } else if (is_seen) {
        write_descriptor(found->second.info, !found->second.may_change, out);
      } else {
        write_descriptor({.param = name}, true, out);
      }
    }
  }
  out.end();
  send(service, request, message);
}

void ParamServices::list(ros2::CdrReader& in, ros2::CdrWriter& out) const {
  const std::vector<std::string> prefixes = read_names(in, "prefixes");
  const auto depth = in.number<std::uint64_t>("depth");
  std::vector<std::string> names;
  for (const auto& [name, unused] : seen()) {
    names.push_back(name);
  }
  const std::vector<std::string> listed = listed_names(names, prefixes, depth);
  std::set<std::string> above;
  for (const std::string& name : listed) {
    if (const std::size_t dot = name.rfind('.'); dot != std::string::npos) {
      above.insert(name.substr(0, dot));
    }
  }
  write_texts(listed, out);
  write_texts({above.begin(), above.end()}, out);
}

ParamServices::Reason ParamServices::change_of(const SeenByName& seen, const RosParam& param,
                                               std::vector<ParamChange>& changes) {
  const auto found = seen.find(param.name);
  if (found == seen.end()) {
    return fmt::format("{}: there is no such parameter, or the gateway does not show it",
                       param.name);
  }
  if (!found->second.may_change) {
    return fmt::format("{}: {}", param.name,
                       found->second.info.is_tunable
                           ? "the gateway lets it be read, and not changed"
                           : "it is not tunable: it is as the application file says");
  }
  std::optional<std::string> json = json_of(found->second.info, param.value);
  if (!json) {
    return fmt::format("{}: expected a value of type {}", param.name, found->second.info.type);
  }
  changes.push_back({.param = param.name, .json = std::move(*json)});
  return {};
}

/// Each is a transaction of its own, one after the other.
void ParamServices::set(const Identity& request, const std::vector<RosParam>& params) {
  struct Pending {
    std::vector<Reason> reasons;
    std::size_t left = 1;  // One more, until all were requested.
  };
  const auto pending = std::make_shared<Pending>();
  pending->reasons.resize(params.size());
  const auto one_less = [this, request, pending] {
    if (--pending->left > 0) {
      return;
    }
    ros2::Buffer message;
    ros2::CdrWriter out(message, ends_[kSet].reply_type);
    out.count(pending->reasons.size());
    for (const Reason& reason : pending->reasons) {
      write_result(reason, out);
    }
    out.end();
    send(kSet, request, message);
  };
  const SeenByName all = seen();
  for (std::size_t i = 0; i < params.size(); ++i) {
    std::vector<ParamChange> changes;
    pending->reasons[i] = change_of(all, params[i], changes);
    if (!changes.empty()) {
      ++pending->left;
      context_.change_params(std::move(changes),
                             [pending, i, one_less](const ParamsResult& result) {
                               pending->reasons[i] = text_of(result);
                               one_less();
                             });
    }
  }
  one_less();
}

void ParamServices::set_atomically(const Identity& request, const std::vector<RosParam>& params) {
  const auto reply = [this, request](const Reason& reason) {
    ros2::Buffer message;
    ros2::CdrWriter out(message, ends_[kSetAtomically].reply_type);
    write_result(reason, out);
    out.end();
    send(kSetAtomically, request, message);
  };
  std::vector<ParamChange> changes;
  std::vector<Reason> reasons;
  const SeenByName all = seen();
  for (const RosParam& param : params) {
    if (Reason reason = change_of(all, param, changes); !reason.empty()) {
      reasons.push_back(std::move(reason));
    }
  }
  if (!reasons.empty() || changes.empty()) {
    reply(fmt::format("{}", fmt::join(reasons, "; ")));
    return;
  }
  context_.change_params(std::move(changes),
                         [reply](const ParamsResult& result) { reply(text_of(result)); });
}

void ParamServices::send(Service service, const Identity& request, ros2::Buffer& message) {
  End& end = ends_[service];
  if (end.writer == nullptr) {
    return;  // The component is stopping.
  }
  try {
    end.writer->write_reply(message, request);
    ++answered;
  } catch (const EngineError& error) {
    fail(service, error.what());
  }
}

void ParamServices::fail(Service service, const std::string& why) {
  ++failed;
  report_(fmt::format("{}: {}", ends_[service].name, why));
}

}  // namespace fastcycle::dds_gateway
