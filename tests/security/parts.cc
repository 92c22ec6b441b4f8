// The components whose messages nobody else may see.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <fastcycle/fastcycle.h>
#include <google/protobuf/wrappers.pb.h>
#include <sys/prctl.h>
#include <unistd.h>

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

/// Receives the secret, keeps it, says once where, and does then what `then` says.
class Listener final : public fastcycle::Component {
 public:
  explicit Listener(fastcycle::Context& context)
      : Component(context), then_(context.param<std::string>("then", {.fallback = "go on"})) {
    context.create_subscriber<Text>("secrets", [this](const Text& text) { on_secret(text); });
  }

 private:
  void on_secret(const Text& text) {
    if (!received_.empty()) {
      return;
    }
    received_ = text.value();
    log().info("secret at {}", static_cast<const void*>(received_.data()));
    if (then_.get() == "abort") {
      std::abort();
    }
    if (then_.get() == "crash") {
      volatile int* const nowhere = nullptr;
      *nowhere = 1;
    }
  }

  fastcycle::Param<std::string> then_;
  std::string received_;
};

/// Has the secret when it is constructed, says in a file of the folder `gate`, named after the
/// process, where in memory it is, and goes on once there is a file `go`.
class Builder final : public fastcycle::Component {
 public:
  explicit Builder(fastcycle::Context& context) : Component(context), secret_(make_secret()) {
    const std::filesystem::path gate = context.param<std::string>("gate").get();
    const std::filesystem::path file = gate / std::to_string(getpid());
    std::ofstream(file.string() + ".part") << static_cast<const void*>(secret_.data());
    std::filesystem::rename(file.string() + ".part", file);
    for (int look = 0; look < 5000 && !std::filesystem::exists(gate / "go"); ++look) {
      usleep(1000);
    }
  }

 private:
  const std::string secret_;
};

/// Makes the memory of the process readable again.
class Opener final : public fastcycle::Component {
 public:
  explicit Opener(fastcycle::Context& context) : Component(context) { prctl(PR_SET_DUMPABLE, 1); }

  void start() override { log().info("started"); }
};

}  // namespace

FASTCYCLE_COMPONENTS(Keeper, Listener, Builder, Opener)
