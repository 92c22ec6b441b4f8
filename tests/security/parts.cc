// The components whose messages nobody else may see.

#include <algorithm>
#include <cstdlib>
#include <string>

#include <fastcycle/fastcycle.h>
#include <google/protobuf/wrappers.pb.h>

namespace {

using Text = google::protobuf::StringValue;

/// The secret, put together while the program runs: no file contains it.
std::string make_secret() {
  std::string text = "52-41-36 nepo srood eht :elddup eht rednu si yek eht";
  std::ranges::reverse(text);
  return text;
}

/// Publishes the secret in every Serve period, and says where in memory it keeps it.
class Keeper final : public fastcycle::Component {
 public:
  explicit Keeper(fastcycle::Context& context)
      : Component(context), secrets_(context.create_publisher<Text>("secrets")) {}

  void start() override { secret_ = make_secret(); }

  void serve() override {
    auto secret = secrets_.loan();
    secret->set_value(secret_);
    secrets_.publish(std::move(secret));
  }

 private:
  fastcycle::Publisher<Text> secrets_;
  std::string secret_;
};

/// Hears the secret, keeps it, says once where, and does then what `then` says.
class Listener final : public fastcycle::Component {
 public:
  explicit Listener(fastcycle::Context& context)
      : Component(context), then_(context.param<std::string>("then", {.fallback = "go on"})) {
    context.create_subscriber<Text>("secrets", [this](const Text& text) { on_secret(text); });
  }

 private:
  void on_secret(const Text& text) {
    if (!heard_.empty()) {
      return;
    }
    heard_ = text.value();
    log().info("secret at {}", static_cast<const void*>(heard_.data()));
    if (then_.get() == "abort") {
      std::abort();
    }
    if (then_.get() == "crash") {
      volatile int* const nowhere = nullptr;
      *nowhere = 1;
    }
  }

  fastcycle::Param<std::string> then_;
  std::string heard_;
};

}  // namespace

FASTCYCLE_COMPONENTS(Keeper, Listener)
