#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "lane_paths.h"
#include "prediction/prediction.pb.h"
#include "scene/scene.pb.h"

namespace ads {

struct PredictorOptions {
  double horizon_s = 6.0;
  double step_s = 0.1;
  /// The distance to the leader at standstill.
  double distance_min_m = 2.0;
  /// Growth of the standard deviations: along by 1/2 a t^2 and by v t, across up to a limit.
  double along_stddev_mps2 = 0.7;
  double along_stddev_mps = 0.3;
  double across_stddev_mps = 0.2;
  double across_stddev_max_m = 1.0;
};

/// Predicts objects by hypotheses with probabilities: along their lane, to the adjacent lane, on a
/// circle, or standing. The README describes the model.
///
/// @threads  Confined.
class Predictor {
 public:
  explicit Predictor(const PredictorOptions& options) : options_(options) {}

  void use(LanePaths lanes) { lanes_ = std::move(lanes); }
  /// Sets all fields except the header.
  void predict(const scene::Scene& scene, prediction::Predictions& predictions) const;

 private:
  // The motion of an object: its path, if it is on a lane, and its progress along it.
  struct Track {
    const scene::SceneObject* source = nullptr;
    std::vector<LanePath> paths = {};  // The first one is the most likely.
    double along_m = 0.0;              // At the start.
    std::optional<std::size_t> leader = {};
    double gap_m = 0.0;              // To the leader, bumper to bumper, at the start.
    std::vector<double> way_m = {};  // From the start, at each step.
    std::vector<double> speed_mps = {};
  };
  struct Across {
    double begin_m = 0.0;
    double speed_mps = 0.0;
    std::optional<double> target_m = {};
    double duration_s = 0.0;
  };

  [[nodiscard]] std::size_t steps() const;
  [[nodiscard]] Track begin(const scene::SceneObject& object) const;
  void find_leaders(std::vector<Track>& tracks) const;
  void drive(std::vector<Track>& tracks) const;
  [[nodiscard]] double acceleration(const Track& track, const std::vector<Track>& tracks,
                                    std::size_t step) const;
  void add_hypotheses(const Track& track, prediction::PredictedObject& predicted) const;
  // Along its lane, and along those that begin where this does and where it may be as well.
  void add_following(const Track& track, double slant_rad, double probability,
                     prediction::PredictedObject& predicted) const;
  // Returns the remaining probability.
  double add_changes(const Track& track, double slant_rad, double probability,
                     prediction::PredictedObject& predicted) const;
  void follow(const Track& track, const LanePath& path, double along_m, const Across& across,
              prediction::Hypothesis& hypothesis) const;
  void turn(const perception::Object& object, prediction::Hypothesis& hypothesis) const;
  void stand(const perception::Object& object, prediction::Hypothesis& hypothesis) const;
  void fill_stddevs(const perception::Object& object, double time_s, bool is_on_lane,
                    prediction::Point& point) const;

  PredictorOptions options_;
  LanePaths lanes_;
};

}  // namespace ads
