#include "osm_file.h"

#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

namespace ads {
namespace {

template <typename Map>
const Map::mapped_type& find(const Map& map, std::string_view what, std::int64_t id,
                             const XmlElement& user) {
  const auto found = map.find(id);
  if (found == map.end()) {
    user.fail(fmt::format("<{}> {}, to which this <{}> refers", what, id, user.name()), "none");
  }
  return found->second;
}

// Without those that an editor has marked as deleted.
std::vector<XmlElement> all(const XmlElement& root, const char* name) {
  std::vector<XmlElement> elements = root.all(name);
  std::erase_if(elements, [](const XmlElement& element) {
    return element.find_attribute("action") == "delete" ||
           element.find_attribute("visible") == "false";
  });
  return elements;
}

template <typename Map, typename T>
void add(const XmlElement& element, Map& map, T value) {
  const auto id = element.number_attribute<std::int64_t>("id");
  if (id == std::numeric_limits<std::int64_t>::min()) {
    element.fail("an id of which there is a negative one", fmt::format("{}", id));
  }
  if (!map.emplace(id, std::move(value)).second) {
    element.fail(fmt::format("no second <{}> {}", element.name(), id), "one");
  }
}

GeodeticPosition read_node(const XmlElement& element) {
  const GeodeticPosition place{.latitude_deg = element.number_attribute<double>("lat"),
                               .longitude_deg = element.number_attribute<double>("lon")};
  if (std::abs(place.latitude_deg) > 90.0 || std::abs(place.longitude_deg) > 180.0) {
    element.fail("lat from -90 to 90 and lon from -180 to 180",
                 fmt::format("{:g} and {:g}", place.latitude_deg, place.longitude_deg));
  }
  return place;
}

OsmRelation read_relation(const XmlElement& element) {
  OsmRelation relation{.element = element, .tags = tags_of(element)};
  for (const XmlElement& member : element.all("member")) {
    relation.members.push_back({.element = member,
                                .type = member.attribute("type"),
                                .role = member.find_attribute("role").value_or(""),
                                .id = member.number_attribute<std::int64_t>("ref")});
  }
  return relation;
}

}  // namespace

Tags tags_of(const XmlElement& element) {
  Tags tags;
  for (const XmlElement& tag : element.all("tag")) {
    tags.emplace(tag.attribute("k"), tag.attribute("v"));
  }
  return tags;
}

std::string_view tag_of(const Tags& tags, std::string_view key) {
  const auto found = tags.find(key);
  return found == tags.end() ? std::string_view() : found->second;
}

OsmFile::OsmFile(const XmlElement& root) {
  if (root.name() != "osm") {
    root.fail("<osm>", fmt::format("<{}>", root.name().substr(0, 40)));
  }
  if (root.attribute("version") != "0.6") {
    root.fail("version 0.6 of <osm>", XmlElement::quoted(root.attribute("version")));
  }
  for (const XmlElement& element : all(root, "node")) {
    add(element, nodes_, read_node(element));
  }
  for (const XmlElement& element : all(root, "way")) {
    OsmWay way{.element = element};
    for (const XmlElement& node : element.all("nd")) {
      way.nodes.push_back(node.number_attribute<std::int64_t>("ref"));
    }
    add(element, ways_, std::move(way));
  }
  for (const XmlElement& element : all(root, "relation")) {
    add(element, relations_, read_relation(element));
  }
}

const GeodeticPosition& OsmFile::node(std::int64_t id, const XmlElement& user) const {
  return find(nodes_, "node", id, user);
}

const OsmWay& OsmFile::way(std::int64_t id, const XmlElement& user) const {
  return find(ways_, "way", id, user);
}

const OsmRelation& OsmFile::relation(std::int64_t id, const XmlElement& user) const {
  return find(relations_, "relation", id, user);
}

}  // namespace ads
