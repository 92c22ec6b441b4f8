#pragma once

#include <fastcycle/fastcycle.h>

#include "hd_map/map.pb.h"
#include "prediction/prediction.pb.h"
#include "predictor.h"
#include "scene/scene.pb.h"

namespace ads {

/// Predicts the motion of the objects.
///
/// In:   `scene/scene`, `map/tile`
/// Out:  `prediction/objects`, for each scene
class Prediction final : public fastcycle::Component {
 public:
  explicit Prediction(fastcycle::Context& context);

 private:
  Predictor predictor_;
  fastcycle::Publisher<prediction::Predictions> predictions_;
};

}  // namespace ads
