#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace ads {

/// The text of a Lanelet2 file for tests, element by element. Nodes lie on a grid of about a metre
/// around 49 N, 8 E: one step east is 1.36665e-5 degrees, one step north 8.9926e-6.
class OsmText {
 public:
  using Tags = std::initializer_list<std::pair<std::string_view, std::string_view>>;
  using Members = std::initializer_list<std::pair<std::string_view, int>>;

  OsmText& node(int id, double east_m, double north_m) {
    text_ += fmt::format("<node id='{}' lat='{:.9f}' lon='{:.9f}'/>\n", id,
                         49.0 + north_m * 8.9926e-6, 8.0 + east_m * 1.36665e-5);
    return *this;
  }
  OsmText& way(int id, std::initializer_list<int> nodes, Tags tags = {}) {
    text_ += fmt::format("<way id='{}'>\n", id);
    for (const int node : nodes) {
      text_ += fmt::format("<nd ref='{}'/>\n", node);
    }
    return end("way", tags);
  }
  /// Members are ways, but for the roles of regulatory elements that are relations.
  OsmText& relation(int id, Members members, Tags tags) {
    text_ += fmt::format("<relation id='{}'>\n", id);
    for (const auto& [role, member] : members) {
      const bool is_relation =
          role == "regulatory_element" || role == "right_of_way" || role == "yield";
      text_ += fmt::format("<member type='{}' ref='{}' role='{}'/>\n",
                           is_relation ? "relation" : "way", member, role);
    }
    return end("relation", tags);
  }
  OsmText& road(int id, int left, int right, Tags more = {}) {
    text_ += fmt::format(
        "<relation id='{}'>\n<member type='way' ref='{}' role='left'/>\n"
        "<member type='way' ref='{}' role='right'/>\n"
        "<tag k='type' v='lanelet'/>\n<tag k='subtype' v='road'/>\n",
        id, left, right);
    return end("relation", more);
  }

  [[nodiscard]] std::string text() const {
    return "<?xml version='1.0'?>\n<osm version='0.6'>\n" + text_ + "</osm>\n";
  }

 private:
  OsmText& end(std::string_view element, Tags tags) {
    for (const auto& [key, value] : tags) {
      text_ += fmt::format("<tag k='{}' v='{}'/>\n", key, value);
    }
    text_ += fmt::format("</{}>\n", element);
    return *this;
  }

  std::string text_;
};

}  // namespace ads
