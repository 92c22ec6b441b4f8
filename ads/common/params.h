#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fastcycle/fastcycle.h>

namespace ads {

/// A parameter of a component: a number from `min` to `max`. Without `fallback` the application
/// file has to set it.
inline fastcycle::Param<double> number_param(fastcycle::Context& context, std::string_view name,
                                             std::optional<double> fallback, double min, double max,
                                             std::string unit, std::string description) {
  return context.param<double>(name, {.fallback = fallback,
                                      .min = min,
                                      .max = max,
                                      .unit = std::move(unit),
                                      .description = std::move(description)});
}

/// Its value at the start.
inline double read_number(fastcycle::Context& context, std::string_view name,
                          std::optional<double> fallback, double min, double max, std::string unit,
                          std::string description) {
  return number_param(context, name, fallback, min, max, std::move(unit), std::move(description))
      .get();
}

}  // namespace ads
