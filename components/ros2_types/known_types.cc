#include "ros2_types/known_types.h"

#include <array>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "basic/basic.pb.h"
#include "diagnostics/diagnostics.pb.h"
#include "fastcycle/assert.h"
#include "foxglove/pose.pb.h"
#include "motion/motion.pb.h"
#include "occupancy/grid.pb.h"
#include "ros2_types/conversions.h"
#include "ros2_types/shipped.h"

namespace fastcycle::ros2 {

namespace {

/// One message of each package that mappings.json names: unreferenced packages are not linked, and
/// would not be found by name.
std::array<const google::protobuf::Message*, 5> shipped_messages() {
  return {&basic::Text::default_instance(), &diagnostics::Report::default_instance(),
          &foxglove::Odometry::default_instance(), &motion::Imu::default_instance(),
          &occupancy::Grid::default_instance()};
}

}  // namespace

KnownTypes::KnownTypes() {
  for (const google::protobuf::Message* const message : shipped_messages()) {
    FASTCYCLE_ASSERT(find_message(message->GetTypeName()) != nullptr,
                     "shipped messages are loaded");
  }
  for (const auto& [name, text] : shipped_interfaces()) {
    definitions_.add_text(name, text);
  }
  mappings_.add(shipped_mappings(), "mappings.json");
}

void KnownTypes::add_mappings(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw MappingError(fmt::format("{}: it cannot be read", file.string()));
  }
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  mappings_.add(text, file.string());
}

std::string KnownTypes::message_of(std::string_view ros) const {
  const Mapping* const mapping = mappings_.find(ros);
  return mapping == nullptr ? "" : mapping->message;
}

const Converter& KnownTypes::find(std::string_view ros, std::string_view message) {
  const std::string full = full_type_name(ros);
  const std::string ours = message.empty() ? message_of(full) : std::string(message);
  if (ours.empty()) {
    throw MappingError(fmt::format(
        "{}: expected a mapping, or the name of a message that it becomes, found none", full));
  }
  std::unique_ptr<Converter>& known = converters_[{full, ours}];
  if (known == nullptr) {
    const google::protobuf::Descriptor* const descriptor = find_message(ours);
    if (descriptor == nullptr) {
      throw MappingError(
          fmt::format("{}: there is no message {} in this process; a component that "
                      "uses it brings it along",
                      full, ours));
    }
    known = std::make_unique<Converter>(definitions_.find(full), *descriptor, mappings_,
                                        shipped_conversions());
  }
  return *known;
}

const Converter* KnownTypes::try_find(std::string_view ros) {
  if (message_of(ros).empty()) {
    return nullptr;
  }
  try {
    return &find(ros);
  } catch (const DefinitionError&) {
    return nullptr;
  }
}

}  // namespace fastcycle::ros2
