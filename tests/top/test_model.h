#pragma once

#include <string>

#include <fmt/format.h>

#include "top/model.h"

namespace fastcycle::tool::top {

/// An application as it may be: some components and topics with all there is to show.
inline Model drive() {
  Model model{.application = "drive",
              .pid = 4711,
              .clock = "live",
              .mode = "highway",
              .up_s = 83,
              .cpu_percent = 34.5,
              .cpus = 2,
              .rss_bytes = 45.1e6,
              .messages_hz = 2345,
              .dropped = 12,
              .faults = 1,
              .interval_s = 1};
  model.components = {{.name = "lidar_driver",
                       .executor = "sensors",
                       .state = "active",
                       .health = "ok",
                       .cpu_percent = 12.5,
                       .activations_hz = 100,
                       .callback = Times{120e3, 1.25e6, 4e6},
                       .lateness = Times{10e3, 50e3, 2e6},
                       .activations = 8300},
                      {.name = "planner",
                       .executor = "main",
                       .state = "active",
                       .health = "degraded",
                       .remark = "the map is old",
                       .cpu_percent = 61.0,
                       .activations_hz = 20,
                       .callback = Times{25e6, 31e6, 48e6},
                       .activations = 1660,
                       .queued = 3,
                       .overruns = 2},
                      {.name = "camera",
                       .executor = "sensors",
                       .state = "failed",
                       .health = "ok",
                       .remark = "std::runtime_error: no device",
                       .cpu_percent = 0,
                       .activations_hz = 0,
                       .activations = 12,
                       .faults = 1,
                       .restarts = 1}};
  model.topics = {{.name = "lidar/points",
                   .type = "lidar.Points",
                   .publishers = {"lidar_driver"},
                   .rate_hz = 100,
                   .bytes_per_s = 400e6,
                   .latency = Times{21e3, 74e3, 1.2e6},
                   .published = 8300,
                   .queued = 3,
                   .depth = 4,
                   .dropped = 12,
                   .dropped_hz = 0,
                   .drops = {{"overflow", 11}, {"fault", 1}},
                   .subscribers = {{.component = "planner",
                                    .kind = "callback",
                                    .delivered = 8285,
                                    .queued = 3,
                                    .depth = 4,
                                    .dropped = 12,
                                    .drops = {{"overflow", 11}, {"fault", 1}},
                                    .latency = Times{21e3, 74e3, 1.2e6}}}},
                  {.name = "plan",
                   .type = "planning.Plan",
                   .publishers = {"planner"},
                   .rate_hz = 20,
                   .published = 1660}};
  return model;
}

/// The same with two latency chains.
inline Model drive_with_chains() {
  Model model = drive();
  model.chains = {{.name = "camera_to_plan",
                   .from = "camera/image",
                   .to = "plan",
                   .on_breach = "count",
                   .deadline_ns = 200e6,
                   .age = Times{80e6, 120e6, 150e6},
                   .count = 800},
                  {.name = "lidar_to_brake",
                   .from = "lidar/points",
                   .to = "brake",
                   .on_breach = "drop",
                   .deadline_ns = 100e6,
                   .age = Times{48e6, 97e6, 131e6},
                   .count = 1660,
                   .breaches = 7,
                   .dropped = 7,
                   .breaches_hz = 0,
                   .contributor = "planner running",
                   .hops = {{.component = "lidar_driver", .topic = "lidar/points"},
                            {.component = "planner",
                             .topic = "plan",
                             .waiting = Times{1e6, 2e6, 3e6},
                             .running = Times{25e6, 31e6, 48e6},
                             .breaches = 7}}}};
  return model;
}

/// The same in two processes.
inline Model drive_in_processes() {
  Model model = drive();
  model.components[0].process = "sensing";
  model.components[0].callbacks = {{.name = "scan", .kind = "tick", .time = Times{1e6, 2e6, 3e6}}};
  model.processes = {{.name = "main",
                      .pid = 4711,
                      .cpu_percent = 20,
                      .rss_bytes = 30e6,
                      .open_files = 41,
                      .threads = {{.name = "main-0", .count = 1, .cpu_percent = 12.5}},
                      .components = {"planner", "camera"}},
                     {.name = "sensing",
                      .pid = 4712,
                      .cpu_percent = 61,
                      .rss_bytes = 15e6,
                      .threads = {{.name = "sensors-0", .count = 1, .cpu_percent = 60},
                                  {.name = "fastcycle", .count = 2}},
                      .components = {"lidar_driver"}}};
  return model;
}

/// An application of so many components and topics, numbered.
inline Model large(int count) {
  Model model{.application = "large", .pid = 1, .clock = "simulated"};
  for (int i = 0; i < count; ++i) {
    model.components.push_back({.name = fmt::format("component_{:03}", i),
                                .state = "active",
                                .cpu_percent = i % 7,
                                .activations_hz = i});
    model.topics.push_back({.name = fmt::format("topic_{:03}", i), .rate_hz = i});
  }
  return model;
}

}  // namespace fastcycle::tool::top
