#pragma once

#include <cstdint>
#include <map>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "common/geodesy.h"
#include "common/xml.h"

namespace ads {

/// The tags of an element of OpenStreetMap. The text belongs to the file.
using Tags = std::map<std::string_view, std::string_view>;

Tags tags_of(const XmlElement& element);
/// Empty if there is no such tag.
std::string_view tag_of(const Tags& tags, std::string_view key);

/// A polyline through nodes.
///
/// @threads  Compatible.
struct OsmWay {
  XmlElement element;
  std::vector<std::int64_t> nodes = {};
};

/// A group of elements, each with a role.
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

/// The elements of an OpenStreetMap file, version 0.6, by id, without those marked as deleted by an
/// editor. The XML must outlive it.
///
/// @threads  Compatible.
/// @errors   Throws `std::runtime_error` with file, line, expected and found: on construction if
///           the file is invalid; on access if the element that `user` references is missing.
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
