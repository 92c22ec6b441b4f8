#include "config/description.h"

#include <algorithm>

#include "config/merge.h"

namespace fastcycle::config {

std::string resolve_topic(const ComponentDescription& component, std::string_view name_in_code) {
  std::string name(name_in_code);
  if (const auto other = component.remap.find(name); other != component.remap.end()) {
    name = other->second;
  }
  return without_slash(placed(component.name_space, name));
}

std::vector<std::size_t> start_order(const ApplicationDescription& application) {
  const auto& components = application.components;
  std::vector<std::size_t> order;
  std::vector<bool> has_started(components.size(), false);
  const auto may_start = [&](std::size_t i) {
    return !has_started[i] && std::ranges::all_of(components[i].after, [&](const auto& name) {
      const auto before = std::ranges::find(components, name, &ComponentDescription::name);
      return before == components.end() ||
             has_started[static_cast<std::size_t>(before - components.begin())];
    });
  };
  while (order.size() < components.size()) {
    std::size_t next = 0;
    while (next < components.size() && !may_start(next)) {
      ++next;
    }
    if (next == components.size()) {  // A circle.
      next = static_cast<std::size_t>(std::ranges::find(has_started, false) - has_started.begin());
    }
    has_started[next] = true;
    order.push_back(next);
  }
  return order;
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

std::string_view to_string(OnBreach on_breach) {
  switch (on_breach) {
    case OnBreach::kCount:
      return "count";
    case OnBreach::kDrop:
      return "drop";
    case OnBreach::kDegrade:
      return "degrade";
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
