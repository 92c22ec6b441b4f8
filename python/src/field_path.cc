#include "field_path.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>

#include "config/nearest.h"
#include "mcap/decode.h"
#include "not_found.h"

namespace fastcycle::python {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

constexpr int kMostIndex = 1'000'000;

std::vector<std::string> names_of(const pb::Descriptor& type) {
  std::vector<std::string> names;
  for (int i = 0; i < type.field_count(); ++i) {
    names.push_back(type.field(i)->name());
  }
  return names;
}

/// `objects[3]` becomes its name and its index.
struct Word {
  std::string_view name;
  int index = -1;
};

Word parse(std::string_view word, std::string_view path) {
  const auto fail = [&] {
    throw std::invalid_argument(fmt::format(
        "{} is no field: write one as header.taken_ns or objects[0].x_m", mcap::shown(path)));
  };
  const std::size_t bracket = word.find('[');
  Word result{.name = word.substr(0, bracket)};
  if (result.name.empty()) {
    fail();
  }
  if (bracket == std::string_view::npos) {
    return result;
  }
  const std::string_view digits = word.substr(bracket + 1);
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, result.index);
  if (error != std::errc() || stop + 1 != end || *stop != ']' || result.index < 0 ||
      result.index > kMostIndex) {
    fail();
  }
  return result;
}

std::vector<Word> words_of(std::string_view path) {
  std::vector<Word> words;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    words.push_back(parse(path.substr(begin, end - begin), path));
    begin = end + 1;
  }
  return words;
}

/// `until`: the path up to the name, for errors.
Step step_of(const pb::Descriptor& type, const Word& word, std::string_view until) {
  const std::string name(word.name);
  const Field* const field = type.FindFieldByName(name);
  if (field == nullptr) {
    throw NotFound(fmt::format(
        "{} has no field {}; {}", type.full_name(), mcap::shown(name),
        type.field_count() == 0 ? "it has none" : config::name_hint(name, names_of(type))));
  }
  if (field->is_repeated() && word.index < 0) {
    throw NotFound(fmt::format("{} of {} is repeated: name one of its elements, {}[0]",
                               mcap::shown(name), type.full_name(), until));
  }
  if (!field->is_repeated() && word.index >= 0) {
    throw NotFound(fmt::format("{} of {} is one value, it has no elements", mcap::shown(name),
                               type.full_name()));
  }
  if (field->type() == Field::TYPE_GROUP) {
    throw NotFound(fmt::format("{} of {} is a group, which cannot be read as columns",
                               mcap::shown(name), type.full_name()));
  }
  return {.field = field, .index = word.index};
}

void add_single_fields(const pb::Descriptor& type, const std::string& before, std::size_t most,
                       std::vector<const pb::Descriptor*>& around,
                       std::vector<std::string>& result) {
  if (std::ranges::find(around, &type) != around.end()) {
    return;  // A type within itself has no end.
  }
  around.push_back(&type);
  for (int i = 0; i < type.field_count() && result.size() < most; ++i) {
    const Field& field = *type.field(i);
    if (field.is_repeated() || field.type() == Field::TYPE_GROUP) {
      continue;
    }
    if (field.message_type() != nullptr) {
      add_single_fields(*field.message_type(), before + field.name() + ".", most, around, result);
    } else {
      result.push_back(before + field.name());
    }
  }
  around.pop_back();
}

}  // namespace

std::vector<Step> find_field(const pb::Descriptor& type, std::string_view path) {
  std::vector<Step> steps;
  const pb::Descriptor* within = &type;
  for (const Word& word : words_of(path)) {
    if (within == nullptr) {
      throw NotFound(fmt::format("{} is no message, it has no field {}",
                                 mcap::shown(steps.back().field->name()), mcap::shown(word.name)));
    }
    const std::string_view until(path.data(), word.name.end());
    steps.push_back(step_of(*within, word, until));
    within = steps.back().field->message_type();
  }
  if (within != nullptr) {
    throw NotFound(fmt::format("{} is a message, {}: name one of its fields, {}.{}",
                               mcap::shown(path), within->full_name(), path,
                               fmt::join(names_of(*within), fmt::format(", {}.", path))));
  }
  return steps;
}

std::vector<std::string> single_fields(const pb::Descriptor& type, std::size_t most) {
  std::vector<const pb::Descriptor*> around;
  std::vector<std::string> result;
  add_single_fields(type, "", most, around, result);
  return result;
}

}  // namespace fastcycle::python
