#include "ros2/converter.h"

#include <optional>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

namespace fastcycle::ros2 {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using Rules = std::map<std::string, Rule, std::less<>>;

/// A resolved path in a message: `pose.position`, `metadata{status}`.
struct Target {
  Way way;
  const FieldDescriptor* to = nullptr;  ///< Null: the message itself.
  std::string key;
};

/// Creates the steps for one pair of types, and for nested pairs.
class Compiler {
 public:
  Compiler(const Mappings& mappings, std::vector<std::string>& unmapped)
      : mappings_(mappings), unmapped_(unmapped) {}

  Steps pair(const Definition& ros, const Descriptor& ours, const std::string& path) {
    static const Mapping kByName;
    const Mapping* const known = mappings_.find(ros.name, ours.full_name());
    const Mapping& mapping = known == nullptr ? kByName : *known;
    if (!mapping.conversion.empty()) {
      fail(ros, ours,
           fmt::format("the conversion \"{}\" is for whole messages", mapping.conversion));
    }
    Steps steps = fields_of(ros, ours, mapping, path);
    if (steps.steps.empty() && !is_empty(ros)) {
      fail(ros, ours, "no field has the same name in both, and there is no mapping");
    }
    return steps;
  }

  Steps fields_of(const Definition& ros, const Descriptor& ours, const Mapping& mapping,
                  const std::string& path) {
    Steps steps;
    for (const auto& [value, numbers] : mapping.absent) {
      Target of_value = follow(ros, ours, value);
      Target of_numbers = follow(ros, ours, numbers);
      if (of_value.to == nullptr || of_value.to->message_type() == nullptr ||
          of_numbers.to == nullptr || !of_numbers.to->is_repeated() ||
          of_numbers.to->cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE) {
        fail(ros, ours,
             fmt::format("\"absent\": expected a message and repeated doubles, found "
                         "\"{}\" and \"{}\"",
                         value, numbers));
      }
      of_value.way.push_back(of_value.to);
      steps.absent.push_back({.value = std::move(of_value.way),
                              .of_numbers = std::move(of_numbers.way),
                              .numbers = of_numbers.to});
    }
    Scope scope{.ros = ros, .ours = ours, .rules = mapping.fields, .absent = steps.absent};
    bool has_any = false;
    add_fields(scope, ros, "", path, ByName{.way = {}, .type = &ours}, steps, has_any);
    check_rules(scope);
    if (!has_any && !is_empty(ros)) {
      steps.steps.clear();
    }
    return steps;
  }

 private:
  static bool is_empty(const Definition& ros) {
    return ros.fields.size() == 1 && ros.fields.front().name == kEmptyField;
  }

  /// Where fields are matched by name; null: nowhere.
  struct ByName {
    Way way;
    const Descriptor* type = nullptr;
  };
  /// Of one mapping.
  struct Scope {
    const Definition& ros;
    const Descriptor& ours;
    const Rules& rules;
    const std::vector<Absent>& absent;
  };

  [[noreturn]] static void fail(const Definition& ros, const Descriptor& ours,
                                const std::string& what) {
    throw MappingError(fmt::format("{} -> {}: {}", ros.name, ours.full_name(), what));
  }

  static bool has_rule_below(const Rules& rules, const std::string& path) {
    const auto next = rules.lower_bound(path);
    return next != rules.end() && next->first.starts_with(path);
  }

  static Target follow(const Definition& ros, const Descriptor& ours, std::string_view path) {
    Target target;
    const Descriptor* type = &ours;
    while (!path.empty()) {
      const std::size_t end = std::min(path.find('.'), path.size());
      std::string_view name = path.substr(0, end);
      path.remove_prefix(std::min(end + 1, path.size()));
      if (const std::size_t brace = name.find('{'); brace != std::string_view::npos) {
        target.key = std::string(name.substr(brace + 1, name.size() - brace - 2));
        name = name.substr(0, brace);
      }
      const FieldDescriptor* const field =
          type == nullptr ? nullptr : type->FindFieldByName(std::string(name));
      if (field == nullptr) {
        fail(ros, ours,
             fmt::format("there is no field \"{}\" in {}", name,
                         type == nullptr ? "a value" : type->full_name()));
      }
      if (target.to != nullptr) {
        if (target.to->is_repeated()) {
          fail(ros, ours, fmt::format("\"{}\" is repeated", target.to->name()));
        }
        target.way.push_back(target.to);
      }
      target.to = field;
      type = field->message_type();
    }
    return target;
  }

  /// Checks that each path of a mapping exists in the type.
  static void check_rules(const Scope& scope) {
    for (const auto& [path, rule] : scope.rules) {
      const Definition* type = &scope.ros;
      std::string_view rest = path;
      while (!rest.empty()) {
        const std::size_t end = std::min(rest.find('.'), rest.size());
        std::string_view name = rest.substr(0, end);
        rest.remove_prefix(std::min(end + 1, rest.size()));
        const bool is_list = name.ends_with("[]");
        if (is_list) {
          name.remove_suffix(2);
        }
        const Field* found = nullptr;
        for (const Field& field : type->fields) {
          found = field.name == name ? &field : found;
        }
        if (found == nullptr || (!rest.empty() && found->message == nullptr) ||
            (is_list && found->shape == Shape::kOne)) {
          fail(scope.ros, scope.ours,
               fmt::format("there is no field \"{}\" in {}", path, type->name));
        }
        type = found->message;
      }
    }
  }

  void add_fields(const Scope& scope, const Definition& ros, const std::string& prefix,
                  const std::string& path, const ByName& by_name, Steps& steps, bool& has_any) {
    for (const Field& field : ros.fields) {
      const std::string rule_path = prefix + field.name;
      const std::string whole_path = path + field.name;
      const auto rule = scope.rules.find(rule_path);
      const auto list_rule = scope.rules.find(rule_path + "[]");
      if (rule != scope.rules.end() && !rule->second.to.empty()) {
        add_one(scope, field, whole_path, follow(scope.ros, scope.ours, rule->second.to),
                rule->second, steps);
        has_any = true;
      } else if (rule != scope.rules.end()) {
        steps.steps.push_back(make_skip(field, whole_path, rule->second.constant));
      } else if (list_rule != scope.rules.end()) {
        std::string to = list_rule->second.to;
        to.resize(to.size() - (to.ends_with("[]") ? 2 : 0));
        add_one(scope, field, whole_path, follow(scope.ros, scope.ours, to), list_rule->second,
                steps);
        has_any = true;
      } else if (field.kind == Kind::kMessage && field.shape != Shape::kOne &&
                 has_rule_below(scope.rules, rule_path + "[].")) {
        add_list(scope, field, rule_path + "[].", whole_path, steps);
        has_any = true;
      } else if (field.kind == Kind::kMessage && field.shape == Shape::kOne &&
                 has_rule_below(scope.rules, rule_path + '.')) {
        ByName inner;
        if (const FieldDescriptor* const same = find_same(by_name, field);
            same != nullptr && same->message_type() != nullptr && !same->is_repeated()) {
          inner = {.way = by_name.way, .type = same->message_type()};
          inner.way.push_back(same);
        }
        add_fields(scope, *field.message, rule_path + '.', whole_path + '.', inner, steps, has_any);
      } else if (const FieldDescriptor* const same = find_same(by_name, field)) {
        add_one(scope, field, whole_path, {.way = by_name.way, .to = same, .key = ""}, {}, steps);
        has_any = true;
      } else {
        if (!is_empty(ros)) {
          unmapped_.push_back(whole_path);
        }
        steps.steps.push_back(make_skip(field, whole_path, {}));
      }
    }
  }

  static const FieldDescriptor* find_same(const ByName& by_name, const Field& field) {
    return by_name.type == nullptr ? nullptr : by_name.type->FindFieldByName(field.name);
  }

  void add_one(const Scope& scope, const Field& field, const std::string& path, Target target,
               const Rule& rule, Steps& steps) {
    const bool is_message = field.kind == Kind::kMessage;
    if (target.to == nullptr) {
      if (!is_message || field.shape != Shape::kOne) {
        fail(scope.ros, scope.ours,
             fmt::format("{} ({}) cannot be a whole message", path, to_text(field)));
      }
      steps.steps.push_back(make_message(field, {}, pair(*field.message, scope.ours, path + '.')));
      return;
    }
    Pair both{.ros = &field, .path = path, .way = target.way, .to = target.to};
    const Descriptor* const type = target.to->message_type();
    std::unique_ptr<Step> step;
    if (!target.key.empty()) {
      if (type != nullptr && target.to->is_repeated() && is_text(type->FindFieldByName("key")) &&
          is_text(type->FindFieldByName("value"))) {
        step = make_keyed(std::move(both), target.key);
      }
    } else {
      Way whole = target.way;
      whole.push_back(target.to);
      const Way* absent = nullptr;
      for (const Absent& one : scope.absent) {
        if (one.numbers == target.to && one.of_numbers == target.way) {
          absent = &one.value;
        }
      }
      step = make_value(both, rule, absent);
      if (step == nullptr && is_message && type != nullptr &&
          target.to->is_repeated() == (field.shape != Shape::kOne)) {
        Steps inner = pair(*field.message, *type, path + '.');
        step = field.shape == Shape::kOne ? make_message(field, std::move(whole), std::move(inner))
                                          : make_messages(std::move(both), std::move(inner));
      }
    }
    if (step == nullptr) {
      fail(scope.ros, scope.ours,
           fmt::format("{} ({}) cannot become {} ({}{})", path, to_text(field),
                       target.to->full_name(), target.to->is_repeated() ? "repeated " : "",
                       type == nullptr ? target.to->type_name() : type->full_name().c_str()));
    }
    steps.steps.push_back(std::move(step));
  }

  static bool is_text(const FieldDescriptor* field) {
    return field != nullptr && field->type() == FieldDescriptor::TYPE_STRING &&
           !field->is_repeated();
  }

  /// A sequence whose elements have rules of their own: they become the elements of one repeated
  /// field, which contains the targets of the rules.
  void add_list(const Scope& scope, const Field& field, const std::string& prefix,
                const std::string& path, Steps& steps) {
    Mapping inner;
    std::optional<std::string> list;
    for (auto at = scope.rules.lower_bound(prefix);
         at != scope.rules.end() && at->first.starts_with(prefix); ++at) {
      Rule rule = at->second;
      if (!rule.to.empty()) {
        const std::size_t end = rule.to.find("[]");
        if (end == std::string::npos || (list && *list != rule.to.substr(0, end))) {
          fail(scope.ros, scope.ours,
               fmt::format("\"{}\": expected a place in the elements of one list, found \"{}\"",
                           at->first, rule.to));
        }
        list = rule.to.substr(0, end);
        rule.to.erase(0, std::min(end + 3, rule.to.size()));
      }
      inner.fields[at->first.substr(prefix.size())] = std::move(rule);
    }
    Target target;
    if (list) {
      target = follow(scope.ros, scope.ours, *list);
    }
    if (target.to == nullptr || !target.to->is_repeated() || target.to->message_type() == nullptr) {
      fail(scope.ros, scope.ours, fmt::format("\"{}\" has no list of messages", prefix));
    }
    Steps of_element;
    const Descriptor& type = *target.to->message_type();
    std::optional<Steps> whole = element_as_whole(field, type, inner, path);
    of_element = whole ? std::move(*whole) : fields_of(*field.message, type, inner, path + ".");
    steps.steps.push_back(
        make_messages({.ros = &field, .path = path, .way = std::move(target.way), .to = target.to},
                      std::move(of_element)));
  }

  /// If one field of the element corresponds to our whole element, and the others have no target: a
  /// pose with a header that becomes a pose.
  std::optional<Steps> element_as_whole(const Field& list, const Descriptor& type,
                                        const Mapping& inner, const std::string& path) {
    const bool has_whole = std::ranges::any_of(inner.fields, [](const auto& field) {
      return field.second.to.empty() && !field.second.constant;
    });
    if (!has_whole) {
      return {};
    }
    Steps steps;
    for (const Field& field : list.message->fields) {
      const std::string whole_path = path + "." + field.name;
      if (inner.fields.contains(field.name) && field.kind == Kind::kMessage) {
        steps.steps.push_back(
            make_message(field, {}, pair(*field.message, type, whole_path + '.')));
      } else {
        unmapped_.push_back(whole_path);
        steps.steps.push_back(make_skip(field, whole_path, {}));
      }
    }
    return steps;
  }

  const Mappings& mappings_;
  std::vector<std::string>& unmapped_;
};

}  // namespace

Converter::Converter(const Definition& ros, const Descriptor& ours, const Mappings& mappings,
                     const Conversions& conversions)
    : ros_(&ros),
      prototype_(google::protobuf::MessageFactory::generated_factory()->GetPrototype(&ours)) {
  const auto fail = [&](const std::string& what) {
    throw MappingError(fmt::format("{} -> {}: {}", ros.name, ours.full_name(), what));
  };
  const Mapping* const mapping = mappings.find(ros.name, ours.full_name());
  if (prototype_ == nullptr) {
    fail("the message is not compiled into this process");
  }
  if (mapping != nullptr && !mapping->constants.empty()) {
    constants_.reset(prototype_->New());
    const auto status =
        google::protobuf::util::JsonStringToMessage(mapping->constants, constants_.get());
    if (!status.ok()) {
      fail(fmt::format("\"constants\": {}", status.ToString()));
    }
  }
  if (mapping != nullptr && !mapping->conversion.empty()) {
    const auto found = conversions.find(mapping->conversion);
    if (found == conversions.end()) {
      fail(fmt::format("there is no conversion \"{}\"", mapping->conversion));
    }
    conversion_ = &found->second;
    return;
  }
  steps_ = Compiler(mappings, unmapped_).pair(ros, ours, "");
}

void Converter::to_message(std::span<const std::byte> message,
                           google::protobuf::Message& out) const {
  CdrReader in(message, ros_->name);
  out.Clear();
  if (constants_ != nullptr) {
    out.MergeFrom(*constants_);
  }
  if (conversion_ != nullptr) {
    conversion_->to_message(in, out);
  } else {
    steps_.read(in, out);
  }
  in.end();
}

void Converter::to_ros(const google::protobuf::Message& message, Buffer& out) const {
  CdrWriter writer(out, ros_->name);
  if (conversion_ != nullptr) {
    conversion_->to_ros(message, writer);
  } else {
    steps_.write(message, writer);
  }
  writer.end();
}

const Descriptor* find_message(std::string_view name) {
  return google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(
      std::string(name));
}

}  // namespace fastcycle::ros2
