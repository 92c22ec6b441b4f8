#include "ros2/names.h"

#include <algorithm>

#include <fmt/format.h>

namespace fastcycle::ros2 {
namespace {

constexpr std::string_view kDds = "::dds_::";

std::string with_slash(std::string_view name) {
  return name.starts_with('/') ? std::string(name) : fmt::format("/{}", name);
}

}  // namespace

std::string dds_topic(std::string_view ros_topic) {
  return "rt" + with_slash(ros_topic);
}

std::string dds_request_topic(std::string_view service) {
  return fmt::format("rq{}Request", with_slash(service));
}

std::string dds_reply_topic(std::string_view service) {
  return fmt::format("rr{}Reply", with_slash(service));
}

std::optional<std::string> ros_topic(std::string_view dds_topic) {
  if (!dds_topic.starts_with("rt/")) {
    return {};
  }
  return std::string(dds_topic.substr(2));
}

std::string dds_type(std::string_view ros_type) {
  std::string name;
  for (const char c : ros_type) {
    if (c == '/') {
      name += "::";
    } else {
      name += c;
    }
  }
  if (const std::size_t last = name.rfind("::"); last != std::string::npos) {
    name.replace(last, 2, kDds);
  }
  return name + '_';
}

std::optional<std::string> ros_type(std::string_view dds_type) {
  const std::size_t dds = dds_type.rfind(kDds);
  if (dds == std::string_view::npos || !dds_type.ends_with('_')) {
    return {};
  }
  std::string name;
  std::string_view front = dds_type.substr(0, dds);
  for (std::size_t at = front.find("::"); at != std::string_view::npos; at = front.find("::")) {
    name += fmt::format("{}/", front.substr(0, at));
    front.remove_prefix(at + 2);
  }
  dds_type.remove_prefix(dds + kDds.size());
  dds_type.remove_suffix(1);
  return fmt::format("{}{}/{}", name, front, dds_type);
}

std::string type_user_data(std::string_view type_hash) {
  return fmt::format("typehash={};", type_hash);
}

std::string_view value_of(std::string_view user_data, std::string_view key) {
  while (!user_data.empty()) {
    const std::size_t end = std::min(user_data.find(';'), user_data.size());
    const std::string_view pair = user_data.substr(0, end);
    user_data.remove_prefix(std::min(end + 1, user_data.size()));
    if (pair.starts_with(key) && pair.substr(key.size()).starts_with('=')) {
      return pair.substr(key.size() + 1);
    }
  }
  return {};
}

std::optional<std::string> ros_name_error(std::string_view name) {
  std::string_view rest = name;
  if (rest.starts_with('/')) {
    rest.remove_prefix(1);
  }
  while (true) {
    const std::string_view part = rest.substr(0, rest.find('/'));
    const bool has_other = std::ranges::any_of(part, [](char c) {
      return !((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == '_');
    });
    if (part.empty() || has_other || (part.front() >= '0' && part.front() <= '9')) {
      return fmt::format(
          "expected parts of letters, digits and _ with / between them, none of which begins with "
          "a digit, found \"{}\"",
          name);
    }
    if (part.size() == rest.size()) {
      return {};
    }
    rest.remove_prefix(part.size() + 1);
  }
}

}  // namespace fastcycle::ros2
