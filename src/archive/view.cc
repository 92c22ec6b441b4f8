#include "archive/view.h"

#include <algorithm>
#include <initializer_list>
#include <string_view>

#include <fmt/format.h>

namespace fastcycle::archive {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMostDecimals = 9;

/// A part of the view, with its place.
struct Part {
  const Json& json;
  std::string place;

  [[noreturn]] void fail(const std::string& expected) const {
    throw ViewError(
        fmt::format("{}: expected {}, found {}", place.empty() ? "/" : place, expected,
                    json.dump(-1, ' ', false, Json::error_handler_t::replace).substr(0, 60)));
  }
  [[nodiscard]] Part at(const std::string& key) const {
    if (!json.is_object() || !json.contains(key)) {
      fail(fmt::format("an object with \"{}\"", key));
    }
    return {json.at(key), place + "/" + key};
  }
  [[nodiscard]] std::optional<Part> find(const std::string& key) const {
    return json.contains(key) ? std::optional<Part>(at(key)) : std::nullopt;
  }
  void expect_only(std::initializer_list<std::string_view> keys) const {
    if (!json.is_object()) {
      fail("an object");
    }
    for (const auto& [key, value] : json.items()) {
      if (std::ranges::find(keys, key) == keys.end()) {
        throw ViewError(fmt::format("{}/{}: there is no such key", place, key));
      }
    }
  }
  [[nodiscard]] std::string text() const {
    if (!json.is_string() || json.get<std::string>().empty()) {
      fail("a name");
    }
    return json.get<std::string>();
  }
  [[nodiscard]] bool flag() const {
    if (!json.is_boolean()) {
      fail("true or false");
    }
    return json.get<bool>();
  }
  [[nodiscard]] std::uint64_t number(std::uint64_t least, std::uint64_t most) const {
    if (!json.is_number_unsigned() || json.get<std::uint64_t>() < least ||
        json.get<std::uint64_t>() > most) {
      fail(fmt::format("a whole number in [{}, {}]", least, most));
    }
    return json.get<std::uint64_t>();
  }
};

std::vector<std::string> split(const std::string& path) {
  std::vector<std::string> names(1);
  for (const char letter : path) {
    if (letter == '.') {
      names.emplace_back();
    } else {
      names.back() += letter;
    }
  }
  return names;
}

PointLayout parse_points(const Part& part) {
  part.expect_only({"stride", "x", "y", "z", "time", "most"});
  PointLayout layout;
  layout.stride = part.at("stride").number(4, 1024);
  const auto offset = [&](const char* key, std::size_t size) {
    return part.at(key).number(0, layout.stride - size);
  };
  layout.x = offset("x", sizeof(float));
  layout.y = offset("y", sizeof(float));
  layout.z = offset("z", sizeof(float));
  if (part.find("time")) {
    layout.time = offset("time", sizeof(std::uint16_t));
  }
  layout.most = part.at("most").number(1, 100'000'000);
  return layout;
}

std::vector<Pick> parse_fields(const Part& part);

Pick parse_pick(const std::string& name, const Part& part) {
  if (part.json.is_string()) {
    return {.name = name, .path = split(part.text())};
  }
  part.expect_only({"from", "decimals", "every", "time", "points", "fields"});
  Pick pick{.name = name, .path = split(part.at("from").text())};
  if (const auto decimals = part.find("decimals")) {
    pick.decimals = static_cast<int>(decimals->number(0, kMostDecimals));
  }
  if (const auto every = part.find("every")) {
    pick.every = static_cast<int>(every->number(1, 1'000'000));
  }
  if (const auto time = part.find("time")) {
    pick.is_time = time->flag();
  }
  if (const auto points = part.find("points")) {
    pick.points = parse_points(*points);
  }
  if (const auto fields = part.find("fields")) {
    pick.fields = parse_fields(*fields);
  }
  return pick;
}

std::vector<Pick> parse_fields(const Part& part) {
  if (!part.json.is_object() || part.json.empty()) {
    part.fail("an object of fields");
  }
  std::vector<Pick> picks;
  for (const auto& [name, value] : part.json.items()) {
    picks.push_back(parse_pick(name, {value, part.place + "/" + name}));
  }
  return picks;
}

std::vector<Layer> parse_layers(const Part& part) {
  if (!part.json.is_object() || part.json.empty()) {
    part.fail("an object of layers");
  }
  std::vector<Layer> layers;
  for (const auto& [name, value] : part.json.items()) {
    const Part one{value, part.place + "/" + name};
    one.expect_only({"topic", "most_hz", "latched", "fields"});
    const auto most_hz = one.find("most_hz");
    const auto latched = one.find("latched");
    layers.push_back(
        {.name = name,
         .topic = one.at("topic").text(),
         .least_period_ns = most_hz ? 1e9 / static_cast<double>(most_hz->number(1, 100'000)) : 0.0,
         .is_latched = latched && latched->flag(),
         .fields = parse_fields(one.at("fields"))});
  }
  return layers;
}

}  // namespace

View parse_view(std::string_view text) {
  Json json;
  try {
    json = Json::parse(text, nullptr, true, true);
  } catch (const Json::parse_error& error) {
    throw ViewError(fmt::format("expected JSON, found a syntax error at byte {}", error.byte));
  }
  const Part part{json, ""};
  part.expect_only({"constants", "layers"});
  return {.constants = json.value("constants", Json::object()),
          .layers = parse_layers(part.at("layers"))};
}

}  // namespace fastcycle::archive
