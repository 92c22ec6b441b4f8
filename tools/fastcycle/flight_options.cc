#include "flight_options.h"

#include <cmath>
#include <cstdint>

namespace fastcycle::tool {

std::string FlightOptions::find_wrong(const config::ApplicationDescription& application) const {
  if (size_mb && !(*size_mb >= 1 && *size_mb <= 1e6)) {
    return "--flight-recorder-mb expects a number from 1 to 1000000";
  }
  if (size_mb && file.empty() && !application.flight_recorder) {
    return "--flight-recorder-mb requires --flight-recorder FILE";
  }
  return {};
}

std::optional<config::FlightRecorderDescription> FlightOptions::describe(
    const config::ApplicationDescription& application) const {
  if (file.empty() && !application.flight_recorder) {
    return std::nullopt;
  }
  config::FlightRecorderDescription description =
      application.flight_recorder.value_or(config::FlightRecorderDescription{});
  if (!file.empty()) {
    description.file = file;
    description.place.file = "the command line";
  }
  if (size_mb) {
    description.bytes = static_cast<std::uint64_t>(std::llround(*size_mb * 1e6));
  }
  return description;
}

}  // namespace fastcycle::tool
