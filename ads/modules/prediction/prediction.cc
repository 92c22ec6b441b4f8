#include "prediction.h"

#include <string>
#include <string_view>
#include <utility>

#include "common/params.h"

namespace ads {
namespace {

PredictorOptions options(fastcycle::Context& context) {
  const PredictorOptions usual;
  return {
      .horizon_s =
          read_number(context, "horizon_s", usual.horizon_s, 0.01, 20.0, "s", "Prediction horizon"),
      .step_s =
          read_number(context, "step_s", usual.step_s, 0.01, 1.0, "s", "Time between two points"),
      .distance_min_m = read_number(context, "distance_min_m", usual.distance_min_m, 0.01, 10.0,
                                    "m", "Distance that objects keep at standstill"),
      .along_stddev_mps2 = read_number(context, "along_stddev_mps2", usual.along_stddev_mps2, 0.01,
                                       5.0, "m/s^2", "Of the acceleration that is not foreseen"),
      .along_stddev_mps =
          read_number(context, "along_stddev_mps", usual.along_stddev_mps, 0.01, 10.0, "m/s",
                      "Standard deviation of unforeseen speed changes"),
      .across_stddev_mps = read_number(context, "across_stddev_mps", usual.across_stddev_mps, 0.01,
                                       5.0, "m/s", "Standard deviation of the lateral motion"),
      .across_stddev_max_m =
          read_number(context, "across_stddev_max_m", usual.across_stddev_max_m, 0.01, 10.0, "m",
                      "Maximum standard deviation of the lateral position in a lane"),
  };
}

}  // namespace

Prediction::Prediction(fastcycle::Context& context)
    : Component(context),
      predictor_(options(context)),
      predictions_(context.create_publisher<prediction::Predictions>("prediction/objects")) {
  context.create_subscriber<hd_map::Tile>(
      "map/tile", [this](const hd_map::Tile& tile) { predictor_.use(LanePaths(tile)); });
  context.create_subscriber<scene::Scene>("scene/scene", {.depth = 1},
                                          [this](const scene::Scene& scene) {
                                            auto predictions = predictions_.loan();
                                            predictions->mutable_header()->CopyFrom(scene.header());
                                            predictor_.predict(scene, *predictions);
                                            predictions_.publish(std::move(predictions));
                                          });
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Prediction)
