#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "ros2/converter.h"
#include "ros2/definition.h"
#include "ros2/mapping.h"

namespace fastcycle::ros2 {

/// The ROS 2 types known to FastCycle, and their conversions: the definitions and mappings that
/// ship with it, and those that a user adds.
///
/// @threads  Confined; any thread may use the returned converters, as long as this lives.
class KnownTypes {
 public:
  /// Contains what ships with FastCycle: interfaces/ and mappings.json.
  KnownTypes();

  /// For adding folders of definitions, which take precedence over those that ship.
  [[nodiscard]] Definitions& definitions() { return definitions_; }
  /// For adding mappings, which take precedence over those that ship.
  [[nodiscard]] Mappings& mappings() { return mappings_; }
  /// Adds those of a file.
  ///
  /// @errors  `MappingError`
  void add_mappings(const std::filesystem::path& file);

  /// The default message for a ROS type; empty if there is no mapping.
  [[nodiscard]] std::string message_of(std::string_view ros) const;

  /// The converter of a ROS type to a message; without one to the default message.
  ///
  /// @errors  `DefinitionError`, `MappingError`
  const Converter& find(std::string_view ros, std::string_view message = {});
  /// None if it has no mapping, or no readable definition.
  const Converter* try_find(std::string_view ros);

 private:
  Definitions definitions_;
  Mappings mappings_;
  std::map<std::pair<std::string, std::string>, std::unique_ptr<Converter>> converters_;
};

}  // namespace fastcycle::ros2
