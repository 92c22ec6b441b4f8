#include "config/description.h"

#include <cstddef>
#include <functional>
#include <queue>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

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
  const std::size_t count = components.size();
  std::unordered_map<std::string_view, std::size_t> places;
  for (std::size_t i = 0; i < count; ++i) {
    places.emplace(components[i].name, i);
  }
  std::vector<std::size_t> waits_for(count, 0);
  std::vector<std::vector<std::size_t>> followers(count);
  for (std::size_t i = 0; i < count; ++i) {
    for (const std::string& name : components[i].after) {
      if (const auto before = places.find(name); before != places.end()) {
        ++waits_for[i];
        followers[before->second].push_back(i);
      }
    }
  }
  // Those that may start, the first in the file on top.
  std::priority_queue<std::size_t, std::vector<std::size_t>, std::greater<>> ready;
  for (std::size_t i = 0; i < count; ++i) {
    if (waits_for[i] == 0) {
      ready.push(i);
    }
  }
  std::vector<std::size_t> order;
  std::vector<bool> has_started(count, false);
  std::size_t first_left = 0;
  while (order.size() < count) {
    while (first_left < count && has_started[first_left]) {
      ++first_left;
    }
    std::size_t next = first_left;  // Of a circle, if none may start.
    if (!ready.empty()) {
      next = ready.top();
      ready.pop();
    }
    if (has_started[next]) {
      continue;  // A circle was begun with it, and what it waited for has started since.
    }
    has_started[next] = true;
    order.push_back(next);
    for (const std::size_t follower : followers[next]) {
      if (--waits_for[follower] == 0) {
        ready.push(follower);
      }
    }
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

std::string_view to_string(OnHang on_hang) {
  switch (on_hang) {
    case OnHang::kReport:
      return "report";
    case OnHang::kStop:
      return "stop";
    case OnHang::kEndProcess:
      return "end_process";
  }
  return "";
}

std::string_view to_string(AfterRestarts then) {
  switch (then) {
    case AfterRestarts::kStay:
      return "stay";
    case AfterRestarts::kProcess:
      return "process";
    case AfterRestarts::kStop:
      return "stop";
    case AfterRestarts::kContinue:
      return "continue";
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

std::string_view to_string(FaultKind kind) {
  switch (kind) {
    case FaultKind::kDrop:
      return "drop";
    case FaultKind::kDelay:
      return "delay";
    case FaultKind::kDuplicate:
      return "duplicate";
    case FaultKind::kFreeze:
      return "freeze";
    case FaultKind::kCorrupt:
      return "corrupt";
    case FaultKind::kThrow:
      return "throw";
    case FaultKind::kSlow:
      return "slow";
    case FaultKind::kHang:
      return "hang";
    case FaultKind::kRestart:
      return "restart";
    case FaultKind::kCrash:
      return "crash";
    case FaultKind::kLeak:
      return "leak";
    case FaultKind::kKill:
      return "kill";
    case FaultKind::kSuspend:
      return "suspend";
  }
  return "";
}

std::string_view to_string(Corruption corruption) {
  switch (corruption) {
    case Corruption::kNan:
      return "nan";
    case Corruption::kValue:
      return "value";
    case Corruption::kBitFlip:
      return "bit_flip";
    case Corruption::kStale:
      return "stale";
  }
  return "";
}

std::string_view to_string(OnExit on_exit) {
  switch (on_exit) {
    case OnExit::kStop:
      return "stop";
    case OnExit::kRestart:
      return "restart";
    case OnExit::kContinue:
      return "continue";
  }
  return "";
}

std::string_view to_string(Sandbox sandbox) {
  return sandbox == Sandbox::kStrict ? "strict" : "none";
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
