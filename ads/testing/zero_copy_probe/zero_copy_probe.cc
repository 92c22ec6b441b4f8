// Intercepts calls between the modules and the framework (LD_PRELOAD). Compares the addresses of
// sweeps when they are published and when a subscriber is called with them, and counts
// serializations.

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include <dlfcn.h>
#include <google/protobuf/message.h>
#include <sys/mman.h>
#include <unistd.h>

#include "control/command.pb.h"
#include "fastcycle/fastcycle.h"
#include "lidar/sweep.pb.h"
#include "localization/ego.pb.h"
#include "perception/objects.pb.h"
#include "planning/plan.pb.h"
#include "prediction/prediction.pb.h"
#include "scene/scene.pb.h"

#define FASTCYCLE_EXPORT __attribute__((visibility("default")))

namespace {

/// The results of the run, written to the file named by ZERO_COPY_PROBE when it ends.
class Testimony {
 public:
  ~Testimony() {
    const char* const file = std::getenv("ZERO_COPY_PROBE");
    std::FILE* const out = file == nullptr ? nullptr : std::fopen(file, "w");
    if (out == nullptr) {
      return;
    }
    std::fprintf(out, R"({"published": %ld, "received": %ld, "elsewhere": %ld, "serialized": %ld})",
                 published_, received_, elsewhere_, serialized_.load());
    std::fclose(out);
  }

  void publish(const google::protobuf::Message* payload) {
    if (const char* const points = points_of(payload)) {
      const std::lock_guard lock(mutex_);
      ++published_;
      written_[payload] = points;
    }
  }

  void receive(const google::protobuf::Message& payload) {
    if (const char* const points = points_of(&payload)) {
      const std::lock_guard lock(mutex_);
      ++received_;
      const auto found = written_.find(&payload);
      elsewhere_ += found == written_.end() || found->second != points ? 1 : 0;
    }
  }

  void serialize() { ++serialized_; }

 private:
  static const char* points_of(const google::protobuf::Message* payload) {
    const auto* const sweep = dynamic_cast<const lidar::Sweep*>(payload);
    return sweep == nullptr ? nullptr : sweep->points().data();
  }

  std::mutex mutex_;
  std::map<const google::protobuf::Message*, const char*> written_;
  long published_ = 0;
  long received_ = 0;
  long elsewhere_ = 0;
  std::atomic<long> serialized_{0};
};

Testimony& testimony() {
  static Testimony the_only;
  return the_only;
}

/// The function that `name` would be without this library.
template <typename Function>
Function* next(const char* name) {
  auto* const found = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  if (found == nullptr) {
    std::fprintf(stderr, "zero_copy_probe: there is no %s\n", name);
    std::abort();
  }
  return found;
}

}  // namespace

namespace fastcycle::detail {

FASTCYCLE_EXPORT void publish_loan(PublisherCore& publisher, Envelope* loan,
                                   const PublishOptions& options) {
  static auto* const publish = next<decltype(publish_loan)>(
      "_ZN9fastcycle6detail12publish_loanERNS0_13PublisherCoreEPNS0_8EnvelopeERKNS_"
      "14PublishOptionsE");
  testimony().publish(loan->own);
  publish(publisher, loan, options);
}

FASTCYCLE_EXPORT Subscription& create_subscription(ComponentCore& core, std::string_view topic,
                                                   const google::protobuf::Message& instance,
                                                   const SubscriberOptions& options,
                                                   EnvelopeCallback callback) {
  static auto* const create = next<decltype(create_subscription)>(
      "_ZN9fastcycle6detail19create_subscriptionERNS0_13ComponentCoreESt17basic_string_viewIcSt11"
      "char_traitsIcEERKN6google8protobuf7MessageERKNS_17SubscriberOptionsESt8functionIFvRNS0_"
      "8EnvelopeESB_EE");
  return create(core, topic, instance, options,
                [callback = std::move(callback)](Envelope& envelope,
                                                 const google::protobuf::Message& payload) {
                  testimony().receive(payload);
                  callback(envelope, payload);
                });
}

}  // namespace fastcycle::detail

namespace {

using Serialize = std::uint8_t*(const void* message, std::uint8_t* target, void* stream);

template <typename T>
struct Watched {
  static inline Serialize* original = nullptr;
  static std::uint8_t* serialize(const void* message, std::uint8_t* target, void* stream) {
    testimony().serialize();
    return original(message, target, stream);
  }
};

/// Every way to serialize a T leads through one virtual function; here its place in the table of
/// the class, `name` by the C++ ABI, is given to another one.
template <typename T>
bool watch(const std::string& name) {
  constexpr std::size_t kSlotsMax = 64;
  auto* const table = static_cast<void**>(dlsym(RTLD_DEFAULT, ("_ZTVN" + name + "E").c_str()));
  void* const function =
      dlsym(RTLD_DEFAULT,
            ("_ZNK" + name + "18_InternalSerializeEPhPN6google8protobuf2io19EpsCopyOutputStreamE")
                .c_str());
  void** const slot = table == nullptr ? nullptr : std::find(table, table + kSlotsMax, function);
  if (function == nullptr || slot == nullptr || slot == table + kSlotsMax) {
    std::fprintf(stderr, "zero_copy_probe: the serialization of %s is not where it should be\n",
                 name.c_str());
    std::abort();
  }
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  auto* const start = reinterpret_cast<void*>(reinterpret_cast<std::uintptr_t>(slot) & ~(page - 1));
  mprotect(start, page, PROT_READ | PROT_WRITE);
  Watched<T>::original = reinterpret_cast<Serialize*>(function);
  *slot = reinterpret_cast<void*>(&Watched<T>::serialize);
  mprotect(start, page, PROT_READ);
  return true;
}

// The messages of the chain from lidar to control, and localization's.
const bool kIsWatching =
    watch<lidar::Sweep>("5lidar5Sweep") && watch<perception::Objects>("10perception7Objects") &&
    watch<scene::Scene>("5scene5Scene") &&
    watch<prediction::Predictions>("10prediction11Predictions") &&
    watch<planning::Plan>("8planning4Plan") && watch<control::Command>("7control7Command") &&
    watch<localization::Ego>("12localization3Ego");

}  // namespace
