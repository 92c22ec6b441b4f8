#include "config/description.h"

#include "config/merge.h"

namespace fastcycle::config {

std::string resolve_topic(const ComponentDescription& component, std::string_view name_in_code) {
  std::string name(name_in_code);
  if (const auto other = component.remap.find(name); other != component.remap.end()) {
    name = other->second;
  }
  return without_slash(placed(component.name_space, name));
}

std::string_view to_string(OnFault on_fault) {
  switch (on_fault) {
    case OnFault::kStopComponent:
      return "stop_component";
    case OnFault::kStop:
      return "stop";
    case OnFault::kRestart:
      return "restart";
  }
  return "";
}

std::string_view to_string(Policy policy) {
  switch (policy) {
    case Policy::kOther:
      return "other";
    case Policy::kFifo:
      return "fifo";
    case Policy::kRr:
      return "rr";
  }
  return "";
}

std::string_view to_string(Wait wait) {
  switch (wait) {
    case Wait::kPark:
      return "park";
    case Wait::kSpin:
      return "spin";
    case Wait::kAdaptive:
      return "adaptive";
  }
  return "";
}

std::string_view to_string(Compression compression) {
  switch (compression) {
    case Compression::kNone:
      return "none";
    case Compression::kLz4:
      return "lz4";
    case Compression::kZstd:
      return "zstd";
  }
  return "";
}

std::string_view to_string(Overflow overflow) {
  switch (overflow) {
    case Overflow::kDropOldest:
      return "drop_oldest";
    case Overflow::kDropNewest:
      return "drop_newest";
  }
  return "";
}

}  // namespace fastcycle::config
