// Compiles a .proto itself instead of linking to a message package, as another library does too.

#include "harmless.h"
#include "twin.pb.h"

namespace {

class Twin final : public fastcycle::Component {
 public:
  explicit Twin(fastcycle::Context& context)
      : Component(context), twins_(context.create_publisher<broken::Twin>("twins")) {}

 private:
  fastcycle::Publisher<broken::Twin> twins_;
};

}  // namespace

FASTCYCLE_COMPONENT(Twin)
