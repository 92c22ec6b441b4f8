#include "new/edits.h"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace fastcycle::tool {
namespace {

constexpr std::size_t kNone = std::string::npos;

bool is_space(char c) {
  return std::isspace(static_cast<unsigned char>(c)) != 0;
}

/// Past the string that begins at `begin`.
std::size_t string_end(std::string_view text, std::size_t begin) {
  std::size_t i = begin + 1;
  while (i < text.size() && text[i] != '"') {
    i += text[i] == '\\' ? 2 : 1;
  }
  return std::min(i + 1, text.size());
}

std::size_t line_end(std::string_view text, std::size_t begin) {
  return std::min(text.find('\n', begin), text.size());
}

// ---- CMake ----

struct Call {
  std::size_t begin = 0;
  std::size_t arguments = 0;
  std::size_t end = 0;  ///< Behind the closing parenthesis.
};

std::optional<Call> next_call(std::string_view cmake, std::string_view function, std::size_t from) {
  std::size_t i = from;
  while (i < cmake.size()) {  // At the beginning of a line.
    const std::size_t begin = cmake.find_first_not_of(" \t", i);
    const std::size_t name_end = begin == kNone ? kNone : begin + function.size();
    if (name_end < cmake.size() && cmake.substr(begin, function.size()) == function &&
        cmake[name_end] == '(') {
      int depth = 0;
      for (std::size_t at = name_end; at < cmake.size();) {
        if (cmake[at] == '"') {
          at = string_end(cmake, at);
          continue;
        }
        if (cmake[at] == '#') {
          at = line_end(cmake, at);
          continue;
        }
        depth += cmake[at] == '(' ? 1 : cmake[at] == ')' ? -1 : 0;
        ++at;
        if (depth == 0) {
          return Call{begin, name_end + 1, at};
        }
      }
    }
    i = line_end(cmake, i) + 1;
  }
  return std::nullopt;
}

std::optional<std::string> first_argument(std::string_view cmake, std::string_view function) {
  const auto call = next_call(cmake, function, 0);
  if (!call) {
    return std::nullopt;
  }
  const std::size_t begin = cmake.find_first_not_of(" \t\n\"", call->arguments);
  const std::size_t end = cmake.find_first_of(" \t\n\")", begin);
  return end == kNone || end == begin
             ? std::nullopt
             : std::optional(std::string(cmake.substr(begin, end - begin)));
}

// ---- JSON with comments ----

/// Past the comment that begins at `i`; `i` if none does.
std::size_t comment_end(std::string_view json, std::size_t i) {
  if (json.substr(i, 2) == "//") {
    return line_end(json, i);
  }
  if (json.substr(i, 2) == "/*") {
    const std::size_t end = json.find("*/", i + 2);
    return end == kNone ? json.size() : end + 2;
  }
  return i;
}

/// From `i` on, the next that is neither space nor comment.
std::size_t next_token(std::string_view json, std::size_t i) {
  while (i < json.size()) {
    const std::size_t end = is_space(json[i]) ? i + 1 : comment_end(json, i);
    if (end == i) {
      break;
    }
    i = end;
  }
  return i;
}

/// Past the string or the single character at `i`.
std::size_t token_end(std::string_view json, std::size_t i) {
  return json[i] == '"' ? string_end(json, i) : i + 1;
}

/// Behind the bracket that opens the list "components" of the outermost object.
std::size_t components_begin(std::string_view json) {
  int depth = 0;
  for (std::size_t i = next_token(json, 0); i < json.size();) {
    const std::size_t end = token_end(json, i);
    depth += json[i] == '{' || json[i] == '[' ? 1 : json[i] == '}' || json[i] == ']' ? -1 : 0;
    if (depth == 1 && json.substr(i, end - i) == "\"components\"") {
      const std::size_t colon = next_token(json, end);
      const std::size_t bracket = colon < json.size() ? next_token(json, colon + 1) : kNone;
      if (bracket < json.size() && json[colon] == ':' && json[bracket] == '[') {
        return bracket + 1;
      }
    }
    i = next_token(json, end);
  }
  return kNone;
}

}  // namespace

std::optional<std::string> project_of(const std::string& cmake) {
  return first_argument(cmake, "project");
}

std::optional<std::string> application_of(const std::string& cmake) {
  return first_argument(cmake, "fastcycle_application");
}

std::string with_call(const std::string& cmake, const std::string& function,
                      const std::string& call, const std::string& otherwise_before) {
  std::size_t position = kNone;
  for (auto found = next_call(cmake, function, 0); found;
       found = next_call(cmake, function, line_end(cmake, found->end))) {
    position = line_end(cmake, found->end);
  }
  std::string result = cmake;
  if (position != kNone) {
    return result.insert(position, "\n" + call);
  }
  if (const auto before = next_call(cmake, otherwise_before, 0)) {
    return result.insert(before->begin, call + "\n");
  }
  return result + (result.ends_with('\n') || result.empty() ? "" : "\n") + call + "\n";
}

std::optional<std::string> with_component(const std::string& application,
                                          const std::string& component) {
  const std::size_t begin = components_begin(application);
  if (begin == kNone) {
    return std::nullopt;
  }
  std::size_t last = begin;  // Behind what the list ends with.
  int depth = 0;
  for (std::size_t i = next_token(application, begin); i < application.size();) {
    const char c = application[i];
    if (c == ']' && depth == 0) {
      std::string result = application;
      if (last == begin) {
        return result.replace(begin, i - begin, "\n    " + component + "\n  ");
      }
      return result.insert(last, ",\n    " + component);
    }
    depth += c == '{' || c == '[' ? 1 : c == '}' || c == ']' ? -1 : 0;
    last = token_end(application, i);
    i = next_token(application, last);
  }
  return std::nullopt;
}

}  // namespace fastcycle::tool
