// Compiled by a test, which expects that FastCycle refuses it; with BY_REFERENCE it is right.
#include <google/protobuf/wrappers.pb.h>

#include "fastcycle/fastcycle.h"

#ifdef BY_REFERENCE
using Given = const google::protobuf::BytesValue&;
#else
using Given = google::protobuf::BytesValue;
#endif

class Viewer final : public fastcycle::Component {
 public:
  explicit Viewer(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<google::protobuf::BytesValue>(
        "images", [](Given image) { static_cast<void>(image); });
    context.create_synchronizer<google::protobuf::BytesValue, google::protobuf::BytesValue>(
        {"left", "right"}, {}, [](Given left, const google::protobuf::BytesValue& right) {
          static_cast<void>(left);
          static_cast<void>(right);
        });
    context.create_subscriber<google::protobuf::BytesValue>("any", [](const auto&) {});
  }
};
