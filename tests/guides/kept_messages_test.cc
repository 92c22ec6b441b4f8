// The code of docs/guides/kept_messages.md.

#include <gtest/gtest.h>

#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace {

// [snippet trip]
class Trip final : public fastcycle::Component {
 public:
  explicit Trip(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<demo::Speed>("speed", {.keep = 1},
                                           [this](const fastcycle::Sample<demo::Speed>& speed) {
                                             if (last_) {
                                               gained_mps_ += speed->mps() - last_->mps();
                                             }
                                             last_ = speed;
                                             report("gained_mps", gained_mps_);
                                           });
  }

 private:
  fastcycle::Sample<demo::Speed> last_;
  double gained_mps_ = 0.0;
};
// [end]

TEST(TheGuideToKeptMessages, ComparesEachMessageWithTheOneBeforeThatItKept) {
  fastcycle::testing::Bench bench;
  bench.add<Trip>("trip");
  auto speeds = bench.input<demo::Speed>("speed");
  bench.start();

  for (const double mps : {3.0, 4.0, 8.5}) {
    demo::Speed speed;
    speed.set_mps(mps);
    speeds.publish(speed);
  }

  EXPECT_EQ(bench.result("trip", "gained_mps"), fastcycle::ReportValue(5.5));
}

}  // namespace
