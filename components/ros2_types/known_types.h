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

/// The types of ROS 2 that FastCycle knows, and what becomes of them: the definitions and mappings
/// that ship with it, and those that a user adds.
///
/// @threads  Confined; the converters that it gives may be used by any thread, as long as it lives.
class KnownTypes {
 public:
  /// Knows what ships with FastCycle: interfaces/ and mappings.json.
  KnownTypes();

  /// For folders of definitions, which stand above those that ship.
  [[nodiscard]] Definitions& definitions() { return definitions_; }
  /// For mappings that stand above those that ship.
  [[nodiscard]] Mappings& mappings() { return mappings_; }
  /// Adds those of a file.
  ///
  /// @errors  `MappingError`
  void add_mappings(const std::filesystem::path& file);

  /// The message that a ROS type becomes if nothing else is said; empty if there is no mapping.
  [[nodiscard]] std::string message_of(std::string_view ros) const;

  /// Of a ROS type and a message; without one, of that which it becomes if nothing else is said.
  ///
  /// @errors  `DefinitionError`, `MappingError`
  const Converter& find(std::string_view ros, std::string_view message = {});
  /// None if it has no mapping, or if no definition of it can be read.
  const Converter* try_find(std::string_view ros);

 private:
  Definitions definitions_;
  Mappings mappings_;
  std::map<std::pair<std::string, std::string>, std::unique_ptr<Converter>> converters_;
};

}  // namespace fastcycle::ros2
