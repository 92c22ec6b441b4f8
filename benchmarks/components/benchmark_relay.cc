#include <cstddef>
#include <cstdint>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "components/payload.h"

namespace {

using fastcycle::benchmark::Payload;

/// Answers each payload on "in" with a new one on "out", which has the same stamps.
class BenchmarkRelay final : public fastcycle::Component {
 public:
  explicit BenchmarkRelay(fastcycle::Context& context)
      : Component(context),
        out_(context.create_publisher<Payload>(
            "out",
            {.prototype = fastcycle::benchmark::prototype(static_cast<std::size_t>(
                 context
                     .param<std::int64_t>("size_bytes", {.fallback = 64, .min = 0, .max = 1 << 30})
                     .get()))})) {
    context.create_subscriber<Payload>("in", [this](const Payload& in) { answer(in); });
  }

 private:
  void answer(const Payload& in) {
    auto out = fastcycle::benchmark::make_payload(out_, in.data().size(), in.number());
    out->set_made_ns(in.made_ns());
    out->set_sent_ns(in.sent_ns());
    out_.publish(std::move(out));
  }

  fastcycle::Publisher<Payload> out_;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkRelay)
