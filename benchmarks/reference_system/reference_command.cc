#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "reference_system/node.h"

namespace fastcycle::benchmark {
namespace {

/// The end of the graph. Writes the history of each sample into the file "samples" when it stops, a
/// line each: the begin of this callback, then for each node `node begin_ns sequence missed`.
class ReferenceCommand final : public Component {
 public:
  explicit ReferenceCommand(Context& context)
      : Component(context), file_(context.param<Path>("samples", {.fallback = Path()})) {
    context.create_subscriber<ReferenceSample>(
        "in", [this](const Sample<ReferenceSample>& sample) { take(*sample); });
  }

  void stop() override {
    report("samples", static_cast<std::int64_t>(lines_.size()));
    if (file_.get().empty()) {
      return;
    }
    std::ofstream out(file_.get());
    for (const std::string& line : lines_) {
      out << line << '\n';
    }
    if (!out.flush()) {
      throw std::runtime_error("cannot write " + file_.get().string());
    }
  }

 private:
  void take(const ReferenceSample& sample) {
    std::string line = std::to_string(measure::now_ns());
    for (const ReferenceStep& step : sample.steps()) {
      line += ' ' + step.node() + ' ' + std::to_string(step.begin_ns()) + ' ' +
              std::to_string(step.sequence()) + ' ' + std::to_string(step.missed());
    }
    lines_.push_back(std::move(line));
  }

  Param<Path> file_;
  std::vector<std::string> lines_;
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::ReferenceCommand)
