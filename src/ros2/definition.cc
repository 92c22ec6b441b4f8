#include "ros2/definition.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>

namespace fastcycle::ros2 {
namespace {

constexpr std::size_t kDepthMax = 32;
constexpr std::size_t kArrayMax = 1'000'000;

struct Primitive {
  std::string_view name;
  Kind kind;
};
// `char` is an unsigned 8-bit number.
constexpr std::array kPrimitives = {
    Primitive{"bool", Kind::kBool},       Primitive{"byte", Kind::kByte},
    Primitive{"char", Kind::kUint8},      Primitive{"int8", Kind::kInt8},
    Primitive{"uint8", Kind::kUint8},     Primitive{"int16", Kind::kInt16},
    Primitive{"uint16", Kind::kUint16},   Primitive{"int32", Kind::kInt32},
    Primitive{"uint32", Kind::kUint32},   Primitive{"int64", Kind::kInt64},
    Primitive{"uint64", Kind::kUint64},   Primitive{"float32", Kind::kFloat32},
    Primitive{"float64", Kind::kFloat64}, Primitive{"string", Kind::kText},
    Primitive{"wstring", Kind::kWideText}};

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) {
    return {};
  }
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

/// A line without its comment; a # in quotes begins none.
std::string_view without_comment(std::string_view line) {
  char quote = '\0';
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (quote != '\0') {
      if (line[i] == '\\') {
        ++i;
      } else if (line[i] == quote) {
        quote = '\0';
      }
    } else if (line[i] == '"' || line[i] == '\'') {
      quote = line[i];
    } else if (line[i] == '#') {
      return line.substr(0, i);
    }
  }
  // The apostrophe of an unquoted text: then the first # counts.
  return quote == '\0' ? line : line.substr(0, line.find('#'));
}

/// Removes and returns the first word of `line`.
std::string_view take_word(std::string_view& line) {
  line = trimmed(line);
  const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
  const std::string_view word = line.substr(0, end);
  line = trimmed(line.substr(end));
  return word;
}

std::optional<std::size_t> number_of(std::string_view text) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value > kArrayMax) {
    return {};
  }
  return value;
}

bool is_name(std::string_view name) {
  return !name.empty() && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
}

/// Whether every part of `name` is a valid name, so that it may be part of a path.
bool is_type_name(std::string_view name) {
  std::size_t parts = 0;
  while (true) {
    const std::size_t slash = name.find('/');
    if (!is_name(name.substr(0, slash))) {
      return false;
    }
    ++parts;
    if (slash == std::string_view::npos) {
      return parts <= 3;
    }
    name.remove_prefix(slash + 1);
  }
}

/// The suffix of a service half that `name` has; else empty.
std::string_view half_of_service(std::string_view name) {
  if (name.find("/srv/") == std::string_view::npos) {
    return {};
  }
  for (const std::string_view half : {"_Request", "_Response"}) {
    if (name.ends_with(half)) {
      return half;
    }
  }
  return {};
}

}  // namespace

std::size_t size_of(Kind kind) {
  switch (kind) {
    case Kind::kBool:
    case Kind::kByte:
    case Kind::kInt8:
    case Kind::kUint8:
      return 1;
    case Kind::kInt16:
    case Kind::kUint16:
      return 2;
    case Kind::kInt32:
    case Kind::kUint32:
    case Kind::kFloat32:
      return 4;
    case Kind::kInt64:
    case Kind::kUint64:
    case Kind::kFloat64:
      return 8;
    default:
      return 0;
  }
}

std::size_t least_bytes_of(const Field& field) {
  if (field.kind == Kind::kMessage) {
    return field.message->least_bytes;
  }
  return field.kind == Kind::kText || field.kind == Kind::kWideText ? 4 : size_of(field.kind);
}

std::string to_text(const Field& field) {
  std::string text;
  if (field.kind == Kind::kMessage) {
    text = field.message->name;
  } else {
    const auto* const known = std::ranges::find_if(kPrimitives, [&](const Primitive& primitive) {
      return primitive.kind == field.kind && primitive.name != "char";
    });
    text = known->name;
  }
  if (field.text_max > 0) {
    text += fmt::format("<={}", field.text_max);
  }
  switch (field.shape) {
    case Shape::kOne:
      return text;
    case Shape::kArray:
      return text + fmt::format("[{}]", field.count);
    case Shape::kSequence:
      return text + "[]";
    case Shape::kBoundedSequence:
      return text + fmt::format("[<={}]", field.count);
  }
  return text;
}

std::string full_type_name(std::string_view name) {
  std::string full(name);
  if (const std::size_t slash = full.find('/');
      slash != std::string::npos && slash == full.rfind('/')) {
    full.insert(slash, "/msg");
  }
  return full;
}

void Definitions::add_folder(std::filesystem::path folder) {
  folders_.push_back(std::move(folder));
}

void Definitions::add_installed() {
  const char* const prefixes = std::getenv("AMENT_PREFIX_PATH");
  std::string_view rest = prefixes == nullptr ? "" : prefixes;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(':'), rest.size());
    if (end > 0) {
      add_folder(std::filesystem::path(rest.substr(0, end)) / "share");
    }
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
}

void Definitions::add_text(std::string_view name, std::string_view text) {
  texts_.insert_or_assign(full_type_name(name), std::string(text));
}

const Definition& Definitions::find(std::string_view name) {
  return find_nested(full_type_name(name), 0);
}

const Definition& Definitions::find_nested(const std::string& name, std::size_t depth) {
  if (const auto found = known_.find(name); found != known_.end()) {
    if (found->second == nullptr) {
      throw DefinitionError(fmt::format("{}: it contains itself", name));
    }
    return *found->second;
  }
  if (!is_type_name(name) || std::ranges::count(name, '/') != 2) {
    throw DefinitionError(
        fmt::format("expected the name of a type, as \"std_msgs/msg/String\", found \"{}\"", name));
  }
  if (depth > kDepthMax) {
    throw DefinitionError(
        fmt::format("{}: types within types are deeper than {}", name, kDepthMax));
  }
  const std::string text = load(name);
  known_[name] = nullptr;  // Until it is complete.
  try {
    auto parsed = std::make_unique<Definition>(parse(name, text, depth));
    return *(known_[name] = std::move(parsed));
  } catch (...) {
    known_.erase(name);
    throw;
  }
}

std::string Definitions::load(const std::string& name) const {
  std::string base = name;
  const std::string_view half = half_of_service(name);
  base.resize(base.size() - half.size());
  const bool is_service = name.find("/srv/") != std::string::npos;
  std::string text;
  bool is_found = false;
  for (const std::filesystem::path& folder : folders_) {
    std::ifstream file(folder / (base + (is_service ? ".srv" : ".msg")), std::ios::binary);
    if (file) {
      text.assign(std::istreambuf_iterator<char>(file), {});
      is_found = true;
      break;
    }
  }
  if (!is_found) {
    const auto known = texts_.find(base);
    if (known == texts_.end()) {
      throw DefinitionError(fmt::format(
          "{}: there is no definition of it, neither one that ships with FastCycle nor one in a "
          "folder",
          name));
    }
    text = known->second;
  }
  if (half.empty()) {
    return text;
  }
  std::size_t line = text.starts_with("---") ? 0 : text.find("\n---");
  if (line == std::string::npos) {
    throw DefinitionError(
        fmt::format("{}: expected a line \"---\" between request and response", base));
  }
  if (half == "_Request") {
    return text.substr(0, line);
  }
  line = text.find('\n', line + 1);
  return line == std::string::npos ? "" : text.substr(line + 1);
}

Definition Definitions::parse(const std::string& name, std::string_view text, std::size_t depth) {
  Definition definition{.name = name, .fields = {}, .constants = {}, .least_bytes = 0};
  std::size_t line_number = 0;
  const auto fail = [&](std::string_view expected, std::string_view found) {
    throw DefinitionError(
        fmt::format("{}: line {}: expected {}, found \"{}\"", name, line_number, expected, found));
  };
  while (!text.empty()) {
    ++line_number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = trimmed(without_comment(text.substr(0, end)));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty()) {
      continue;
    }
    const std::string_view whole = line;
    std::string_view type = take_word(line);
    std::string_view field_name = line;
    // A constant is `TYPE NAME=value`; a default after the name is ignored.
    const std::size_t equals = field_name.find('=');
    field_name =
        field_name.substr(0, std::min(field_name.find_first_of(" \t="), field_name.size()));
    if (!is_name(field_name)) {
      fail("a type and a name", whole);
    }
    const std::string_view behind = trimmed(line.substr(field_name.size()));
    if (equals != std::string_view::npos && behind.starts_with('=')) {
      definition.constants.push_back(
          {.name = std::string(field_name), .value = std::string(trimmed(behind.substr(1)))});
      continue;
    }

    Field field;
    field.name = field_name;
    if (const std::size_t bracket = type.find('['); bracket != std::string_view::npos) {
      if (!type.ends_with(']')) {
        fail("a type", type);
      }
      std::string_view inside = type.substr(bracket + 1, type.size() - bracket - 2);
      type = type.substr(0, bracket);
      field.shape = inside.empty()             ? Shape::kSequence
                    : inside.starts_with("<=") ? Shape::kBoundedSequence
                                               : Shape::kArray;
      if (field.shape == Shape::kBoundedSequence) {
        inside.remove_prefix(2);
      }
      if (field.shape != Shape::kSequence) {
        const auto count = number_of(inside);
        if (!count || *count == 0) {
          fail(fmt::format("a count from 1 to {}", kArrayMax), inside);
        }
        field.count = *count;
      }
    }
    if (const std::size_t bound = type.find("<="); bound != std::string_view::npos) {
      const auto most = number_of(type.substr(bound + 2));
      type = type.substr(0, bound);
      if (!most || *most == 0 || (type != "string" && type != "wstring")) {
        fail("a bounded string", whole);
      }
      field.text_max = *most;
    }
    const auto* const primitive = std::ranges::find(kPrimitives, type, &Primitive::name);
    if (primitive != kPrimitives.end()) {
      field.kind = primitive->kind;
    } else {
      if (!is_type_name(type)) {
        fail("a type", type);
      }
      field.kind = Kind::kMessage;
      std::string full = full_type_name(type);
      if (full.find('/') == std::string::npos) {
        full = fmt::format("{}/msg/{}", name.substr(0, name.find('/')), full);
      }
      field.message = &find_nested(full, depth + 1);
    }
    definition.fields.push_back(std::move(field));
  }
  if (definition.fields.empty()) {
    // The wire form of a type without fields.
    Field field;
    field.name = kEmptyField;
    field.kind = Kind::kUint8;
    definition.fields.push_back(std::move(field));
  }
  for (const Field& field : definition.fields) {
    const std::size_t each = least_bytes_of(field);
    definition.least_bytes += field.shape == Shape::kOne     ? each
                              : field.shape == Shape::kArray ? field.count * each
                                                             : 4;
  }
  return definition;
}

}  // namespace fastcycle::ros2
