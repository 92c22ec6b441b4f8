#pragma once

#include <cstdint>
#include <map>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "common/geodesy.h"
#include "common/xml.h"

namespace ads {

/// What an element of OpenStreetMap says of itself. The text belongs to the file.
using Tags = std::map<std::string_view, std::string_view>;

Tags tags_of(const XmlElement& element);
/// Empty if there is no such tag.
std::string_view tag_of(const Tags& tags, std::string_view key);

/// A line through nodes.
///
/// @threads  Compatible.
struct OsmWay {
  XmlElement element;
  std::vector<std::int64_t> nodes = {};
};

/// Elements that belong together, each in a role.
///
/// @threads  Compatible.
struct OsmRelation {
  struct Member {
    XmlElement element;
    std::string_view type;
    std::string_view role;
    std::int64_t id = 0;
  };
  XmlElement element;
  Tags tags = {};
  std::vector<Member> members = {};
};

/// A file of OpenStreetMap, version 0.6: what is in it, by its number, without what an editor has
/// marked as deleted. The XML outlives it.
///
/// @threads  Compatible.
/// @errors   Throws `std::runtime_error` that names file, line, expected and found: of what the
/// file
///           does not say rightly, when it is made; of an element that there is not, when `user`
///           asks for it.
class OsmFile {
 public:
  explicit OsmFile(const XmlElement& root);

  [[nodiscard]] const std::map<std::int64_t, OsmRelation>& relations() const { return relations_; }
  [[nodiscard]] const GeodeticPosition& node(std::int64_t id, const XmlElement& user) const;
  [[nodiscard]] const OsmWay& way(std::int64_t id, const XmlElement& user) const;
  [[nodiscard]] const OsmRelation& relation(std::int64_t id, const XmlElement& user) const;

 private:
  std::unordered_map<std::int64_t, GeodeticPosition> nodes_;
  std::unordered_map<std::int64_t, OsmWay> ways_;
  std::map<std::int64_t, OsmRelation> relations_;
};

}  // namespace ads
