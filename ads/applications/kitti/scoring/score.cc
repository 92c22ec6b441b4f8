#include "score.h"

#include <algorithm>
#include <cstddef>
#include <tuple>

namespace kitti {
namespace {

double ratio(double part, std::int64_t whole) {
  return whole > 0 ? part / static_cast<double>(whole) : 0.0;
}

double distance_m(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (a - b).head<2>().norm();
}

}  // namespace

std::vector<Verdict> Score::add(const LabelledFrame& frame, std::span<const FoundBox> boxes) {
  std::vector<std::tuple<bool, double, std::size_t, std::size_t>> pairs;
  for (std::size_t label = 0; label < frame.labels.size(); ++label) {
    const Label& its = frame.labels[label];
    if (its.kind != kind_) {
      continue;
    }
    const auto before = box_of_.find(its.track);
    for (std::size_t box = 0; box < boxes.size(); ++box) {
      const double distance = distance_m(its.center_m, boxes[box].center_m);
      if (boxes[box].kind == kind_ && distance < config_.distance_max_m) {
        const bool is_new = before == box_of_.end() || before->second != boxes[box].id;
        pairs.emplace_back(is_new, distance, label, box);
      }
    }
  }
  std::ranges::sort(pairs);
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> box_of_label(frame.labels.size(), kNone);
  std::vector<std::size_t> label_of_box(boxes.size(), kNone);
  for (const auto& [is_new, distance, label, box] : pairs) {
    if (box_of_label[label] != kNone || label_of_box[box] != kNone) {
      continue;
    }
    box_of_label[label] = box;
    label_of_box[box] = label;
    const auto [last, is_first] = box_of_.try_emplace(frame.labels[label].track, boxes[box].id);
    if (counts(frame.labels[label].center_m)) {
      id_switches_ += !is_first && last->second != boxes[box].id ? 1 : 0;
      distance_sum_m_ += distance;
      ++found_;
    }
    last->second = boxes[box].id;
  }
  missed_.assign(frame.labels.size(), false);
  for (std::size_t label = 0; label < frame.labels.size(); ++label) {
    if (frame.labels[label].kind == kind_ && counts(frame.labels[label].center_m)) {
      ++labels_;
      missed_[label] = box_of_label[label] == kNone;
    }
  }
  std::vector<Verdict> verdicts(boxes.size(), Verdict::kNeither);
  for (std::size_t box = 0; box < boxes.size(); ++box) {
    if (boxes[box].kind != kind_) {
      continue;
    }
    if (label_of_box[box] != kNone) {
      verdicts[box] =
          counts(frame.labels[label_of_box[box]].center_m) ? Verdict::kRight : Verdict::kNeither;
    } else if (counts(boxes[box].center_m) && !is_excused(frame, boxes[box].center_m)) {
      verdicts[box] = Verdict::kFalse;
      ++false_boxes_;
    }
  }
  ++frames_;
  return verdicts;
}

bool Score::counts(const Eigen::Vector3d& center_m) const {
  const auto pixel = calibration_.pixel_of(center_m);
  return pixel && (pixel->array() >= 0.0).all() &&
         (pixel->array() < config_.image_size.array()).all() &&
         center_m.head<2>().norm() < config_.range_max_m;
}

bool Score::is_excused(const LabelledFrame& frame, const Eigen::Vector3d& center_m) const {
  const auto pixel = calibration_.pixel_of(center_m);
  return (pixel && std::ranges::any_of(frame.dont_care,
                                       [&](const DontCare& part) {
                                         return (pixel->array() >= part.least.array()).all() &&
                                                (pixel->array() <= part.most.array()).all();
                                       })) ||
         std::ranges::any_of(frame.labels, [&](const Label& label) {
           return label.kind != kind_ &&
                  distance_m(label.center_m, center_m) < config_.distance_max_m;
         });
}

double Score::precision() const {
  return ratio(static_cast<double>(found_), found_ + false_boxes_);
}

double Score::recall() const {
  return ratio(static_cast<double>(found_), labels_);
}

double Score::false_boxes_per_frame() const {
  return ratio(static_cast<double>(false_boxes_), frames_);
}

double Score::mota() const {
  const auto errors = static_cast<double>(labels_ - found_ + false_boxes_ + id_switches_);
  return labels_ > 0 ? 1.0 - ratio(errors, labels_) : 0.0;
}

double Score::distance_mean_m() const {
  return ratio(distance_sum_m_, found_);
}

}  // namespace kitti
