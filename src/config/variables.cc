#include "config/variables.h"

#include <memory>
#include <optional>
#include <utility>

#include "base/utf8.h"
#include "config/nearest.h"
#include "config/parse.h"

namespace fastcycle::config {

namespace {

bool is_scalar(const Value& value) {
  return !value.is_null() && !value.is_array() && !value.is_object();
}

bool is_same_kind(const Value& a, const Value& b) {
  return (a.is_number() && b.is_number()) || (a.is_bool() && b.is_bool()) ||
         (a.is_string() && b.is_string());
}

std::string kind_of(const Value& value) {
  if (value.is_bool()) {
    return "true or false";
  }
  return value.is_number() ? "a number" : "a string";
}

std::string as_text(const Value& value) {
  return value.is_string() ? value.as_string() : value.to_text();
}

std::shared_ptr<const Source> path_base_of(const Value& value) {
  return value.path_base() ? value.path_base() : value.source();
}

/// A part of a string: text as it is, or a variable's name.
struct Piece {
  std::string text;
  bool is_variable = false;
};

// None if a variable is not closed.
std::optional<std::vector<Piece>> split(const std::string& text) {
  std::vector<Piece> pieces;
  std::string plain;
  const auto end_plain = [&] {
    if (!plain.empty()) {
      pieces.push_back({std::exchange(plain, {}), false});
    }
  };
  for (std::size_t at = 0; at < text.size();) {
    if (text.compare(at, 3, "$${") == 0) {
      plain += "${";
      at += 3;
    } else if (text.compare(at, 2, "${") == 0) {
      const std::size_t end = text.find('}', at);
      if (end == std::string::npos) {
        return std::nullopt;
      }
      end_plain();
      pieces.push_back({text.substr(at + 2, end - at - 2), true});
      at = end + 1;
    } else {
      plain += text[at++];
    }
  }
  end_plain();
  return pieces;
}

}  // namespace

void Variables::declare(const Value& variables) {
  for (const auto& [name, value] : variables.members()) {
    index_of_[name] = variables_.size();
    variables_.push_back(
        {.name = name, .declared = value, .value = value, .is_given = is_scalar(value)});
  }
  usable_count_ = variables_.size();
}

void Variables::give(const Value& values, Problems& problems) {
  for (const auto& [name, value] : values.members()) {
    give_one(name, value, problems);
  }
}

void Variables::give_option(const std::string& option, Problems& problems) {
  const std::string whole = "--var " + option;
  const std::size_t equals = option.find('=');
  if (equals == std::string::npos || equals == 0) {
    problems.add(make_error({whole, 0, ""}, "expected name=value, found " + in_quotes(option)));
    return;
  }
  if (!base::is_utf8(option)) {
    problems.add(make_error({whole, 0, ""}, "the option is not UTF-8"));
    return;
  }
  const std::string name = option.substr(0, equals);
  const std::string text = option.substr(equals + 1);
  const auto index = index_of_.find(name);
  const bool is_text = index != index_of_.end() && variables_[index->second].declared.is_string();
  Value value = parse_option(text, whole);
  if (is_text || !is_scalar(value)) {
    value = Value(text, value.origin());
  }
  give_one(name, std::move(value), problems);
}

void Variables::give_one(std::string_view name, Value value, Problems& problems) {
  Variable* variable = find_declared(name, value.place(), problems);
  if (variable == nullptr || !is_scalar(value)) {
    return;
  }
  if (is_scalar(variable->declared) && !is_same_kind(variable->declared, value)) {
    problems.add(unexpected(value, kind_of(variable->declared) + ", as the variable's default is"));
    return;
  }
  variable->value = std::move(value);
  variable->is_given = true;
}

Variables::Variable* Variables::find_declared(std::string_view name, const Place& place,
                                              Problems& problems) {
  const auto found = index_of_.find(name);
  if (found != index_of_.end() && found->second < usable_count_) {
    return &variables_[found->second];
  }
  Problem problem = make_error(place, "there is no variable " + in_quotes(name),
                               did_you_mean(nearest(name, names())));
  if (found != index_of_.end()) {
    problem.hint = "a default may use the variables that are declared before it";
  } else if (problem.hint.empty()) {
    problem.hint = variables_.empty() ? "the file declares no \"variables\""
                                      : "it has to be declared in \"variables\"";
  }
  problems.add(std::move(problem));
  return nullptr;
}

void Variables::complete(Problems& problems) {
  for (usable_count_ = 0; usable_count_ < variables_.size(); ++usable_count_) {
    Variable& variable = variables_[usable_count_];
    const bool is_default = variable.value.place() == variable.declared.place();
    if (is_default) {
      substitute(variable.value, problems);
    }
    if (!variable.is_given && variable.declared.is_null()) {
      problems.add(make_error(variable.declared.place(),
                              "the variable " + in_quotes(variable.name) + " has no value",
                              "give it with --var " + variable.name + "=…"));
    }
  }
}

void Variables::substitute(Value& value, Problems& problems) {
  if (value.is_string()) {
    if (value.as_string().find("${") != std::string::npos) {
      value = substitute_text(value, problems);
    }
  } else if (value.is_array()) {
    for (Value& item : value.items()) {
      substitute(item, problems);
    }
  } else if (value.is_object()) {
    for (auto& member : value.members()) {
      substitute(member.value, problems);
    }
  }
}

Value Variables::substitute_text(const Value& value, Problems& problems) {
  const auto pieces = split(value.as_string());
  if (!pieces) {
    problems.add(make_error(value.place(), "a variable has no closing }: " + shown(value),
                            "write $${ where no variable is meant"));
    return value;
  }
  std::string text;
  std::shared_ptr<const Source> path_base = value.path_base();
  for (const Piece& piece : *pieces) {
    if (!piece.is_variable) {
      text += piece.text;
      continue;
    }
    const Variable* variable = find_declared(piece.text, value.place(), problems);
    if (variable == nullptr || !variable->is_given) {
      continue;
    }
    const std::string inserted = as_text(variable->value);
    if (!count_inserted(inserted.size(), value.place(), problems)) {
      return value;
    }
    if (pieces->size() == 1 && !variable->value.is_string()) {
      return Value(variable->value.content(), value.origin());
    }
    if (&piece == &pieces->front()) {
      path_base = path_base_of(variable->value);
    }
    text += inserted;
  }
  Value replaced = Value::string_at(value, std::move(text));
  replaced.set_path_base(std::move(path_base));
  return replaced;
}

bool Variables::count_inserted(std::size_t bytes, const Place& place, Problems& problems) {
  inserted_bytes_ += bytes;
  if (inserted_bytes_ <= kMaxInsertedBytes) {
    return true;
  }
  problems.add(make_error(place, "the variables of this file add more than 16 MiB"));
  return false;
}

std::vector<std::string> Variables::names() const {
  std::vector<std::string> result;
  for (const Variable& variable : variables_) {
    result.push_back(variable.name);
  }
  return result;
}

std::string escape_variables(const std::string& text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text.compare(i, 2, "${") == 0) {
      result += '$';
    }
    result += text[i];
  }
  return result;
}

}  // namespace fastcycle::config
