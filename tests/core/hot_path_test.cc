// What must hold of publish: no copy, no allocation, no way to write into a published message.

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <type_traits>
#include <utility>
#include <variant>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "counting_allocator.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle {
namespace {

using google::protobuf::BytesValue;
using host::TestClasses;

constexpr int kWarmUp = 300;
constexpr int kCounted = 1'000;

/// Publishes `size` bytes, two messages a tick, and counts the allocations of the whole process
/// between its 300th and its 1300th message.
class Camera final : public Component {
 public:
  explicit Camera(Context& context)
      : Component(context),
        size_(context.param<std::int64_t>("size")),
        clears_(context.param<bool>("clears")),
        images_(context.create_publisher<BytesValue>("images", {.prototype = prototype()})),
        source_(context.create_source()) {}

  void serve() override {
    for (int i = 0; i < 2; ++i) {
      if (sent_ == kWarmUp) {
        before_ = allocation_count();
      }
      auto image = clears_.get() ? images_.loan() : images_.loan_uncleared();
      std::string& bytes = *image->mutable_value();
      bytes.resize(static_cast<std::size_t>(size_.get()), 'x');
      std::copy_n("fastcycle", 9, bytes.begin());
      images_.publish(std::move(image));
      ++sent_;
    }
    if (sent_ >= kWarmUp + kCounted && !is_done_) {
      is_done_ = true;
      report("allocations", static_cast<std::int64_t>(allocation_count() - before_));
      source_.finish();
    }
  }

 private:
  [[nodiscard]] BytesValue prototype() const {
    BytesValue message;
    message.set_value(std::string(static_cast<std::size_t>(size_.get()), 'x'));
    return message;
  }

  Param<std::int64_t> size_;
  Param<bool> clears_;
  Publisher<BytesValue> images_;
  Source source_;
  int sent_ = 0;
  bool is_done_ = false;
  std::uint64_t before_ = 0;
};

class Viewer final : public Component {
 public:
  explicit Viewer(Context& context) : Component(context) {
    context.create_subscriber<BytesValue>(
        "images", {.depth = 4, .keep = 1},
        [this](const Sample<BytesValue>& image) { last_ = image; });
  }

 private:
  Sample<BytesValue> last_;
};

class Forwarder final : public Component {
 public:
  explicit Forwarder(Context& context)
      : Component(context), out_(context.create_publisher<BytesValue>("forwarded")) {
    // What it forwards waits for its own subscriber: up to 4, one more being read, one kept.
    context.create_subscriber<BytesValue>(
        "images", {.depth = 4, .keep = 6},
        [this](const Sample<BytesValue>& image) { out_.publish(image); });
  }

 private:
  Publisher<BytesValue> out_;
};

TEST(HotPath, AllocatesNothingPerPublishAfterWarmUpAtAnySize) {
  setenv("FASTCYCLE_POISON", "off", 1);  // Otherwise each message is made anew.
  TestClasses classes;
  classes.with<Camera>("camera").with<Viewer>("viewer").with<Forwarder>("forwarder");
  for (const auto& [size, clears] : {std::pair{"64", "true"}, std::pair{"4194304", "false"}}) {
    const auto application = host::make_application(std::string(R"({"name": "t", "components": [
          {"name": "camera", "library": "camera", "serve_period_ms": 0.2,
           "params": {"size": )") + size + R"(, "clears": )" +
                                                        clears + R"(}},
          {"name": "viewer", "library": "viewer"},
          {"name": "forwarder", "library": "forwarder"},
          {"name": "last", "library": "viewer", "remap": {"images": "forwarded"}}]})",
                                                    classes);

    application->start();
    application->run(std::nullopt);
    application->stop();

    EXPECT_EQ(application->components()[0]->results.at("allocations"), ReportValue(std::int64_t{0}))
        << size << " bytes";
  }
}

/// Notes at which address each message lay.
class ZeroCopyProbe final : public Component {
 public:
  explicit ZeroCopyProbe(Context& context) : Component(context) {
    context.create_subscriber<BytesValue>("images", {.depth = 64}, [this](const BytesValue& image) {
      report(image.value(), static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(&image)));
    });
  }
};

class Photographer final : public Component {
 public:
  explicit Photographer(Context& context)
      : Component(context), images_(context.create_publisher<BytesValue>("images")) {}
  void serve() override {
    if (sent_ < 10) {
      auto image = images_.loan();
      image->set_value("image " + std::to_string(++sent_));
      report(image->value(), static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(&*image)));
      images_.publish(std::move(image));
    }
  }

 private:
  Publisher<BytesValue> images_;
  int sent_ = 0;
};

TEST(HotPath, EverySubscriberReadsTheVeryMessageThatWasWrittenAlsoThroughAForwarder) {
  TestClasses classes;
  classes.with<Photographer>("photographer")
      .with<ZeroCopyProbe>("zero_copy_probe")
      .with<Forwarder>("forwarder");
  for (const int subscribers : {1, 2, 64}) {
    std::string text = R"({"name": "t", "components": [
      {"name": "photographer", "library": "photographer", "serve_period_ms": 1},
      {"name": "forwarder", "library": "forwarder"})";
    for (int i = 0; i < subscribers; ++i) {
      text += R"(,{"name": "w)" + std::to_string(i) + R"(", "library": "zero_copy_probe"})";
      text += R"(,{"name": "f)" + std::to_string(i) +
              R"(", "library": "zero_copy_probe", "remap": {"images": "forwarded"}})";
    }
    const auto application = host::make_application(text + "]}", classes, {.is_simulated = true});

    application->start();
    application->run(Duration(std::chrono::milliseconds(20)));
    application->stop();

    const auto& written = application->components()[0]->results;
    ASSERT_EQ(written.size(), 10U);
    for (std::size_t i = 2; i < application->components().size(); ++i) {
      EXPECT_EQ(application->components()[i]->results, written);
    }
  }
}

// The public API gives no way to write into a message once it is published.
template <typename S>
concept CanWriteThroughArrow = requires(S sample) { sample->set_value(""); };
template <typename S>
concept CanWriteThroughStar = requires(S sample) { (*sample).set_value(""); };
template <typename S>
concept CanWriteThroughGet = requires(S sample) { sample.get()->set_value(""); };
static_assert(!CanWriteThroughArrow<Sample<BytesValue>>);
static_assert(!CanWriteThroughStar<Sample<BytesValue>>);
static_assert(!CanWriteThroughGet<Sample<BytesValue>>);
static_assert(CanWriteThroughArrow<Loan<BytesValue>>, "so the checks above can fail");
static_assert(!std::is_copy_constructible_v<Loan<BytesValue>>, "one writer");
static_assert(!MessageCallback<void (*)(BytesValue&), BytesValue>, "callbacks get it const");

class DoublePublisher final : public Component {
 public:
  explicit DoublePublisher(Context& context)
      : Component(context), images_(context.create_publisher<BytesValue>("images")) {}
  void serve() override {
    auto loan = images_.loan();
    images_.publish(std::move(loan));
    loan->set_value("too late");
  }

 private:
  Publisher<BytesValue> images_;
};

TEST(HotPathDeathTest, APublishedLoanIsNotWrittenAnyMore) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_DEATH(
      {
        TestClasses classes;
        classes.with<DoublePublisher>("double");
        const auto application = host::make_application(
            R"({"name": "t", "components": [
               {"name": "d", "library": "double", "serve_period_ms": 1}]})",
            classes, {.is_simulated = true});
        application->start();
        application->run(Duration(std::chrono::milliseconds(2)));
      },
      "component \"d\": a loan for \"images\" is used after it was published");
}

class EarlyPublisher final : public Component {
 public:
  explicit EarlyPublisher(Context& context)
      : Component(context), images_(context.create_publisher<BytesValue>("images")) {
    images_.publish(images_.loan());
  }

 private:
  Publisher<BytesValue> images_;
};

TEST(HotPathDeathTest, PublishingInAConstructorBreaksTheContract) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  TestClasses classes;
  classes.with<EarlyPublisher>("early");
  EXPECT_DEATH(host::make_application(
                   R"({"name": "t", "components": [{"name": "e", "library": "early"}]})", classes),
               "component \"e\": loan\\(\\) for \"images\" outside of a callback");
}

/// Publishes on two topics in each activation, once the messages before were read.
class TwoTopics final : public Component {
 public:
  explicit TwoTopics(Context& context)
      : Component(context),
        first_(context.create_publisher<BytesValue>("first")),
        images_(context.create_publisher<BytesValue>("images")),
        source_(context.create_source()) {
    context.create_subscriber<BytesValue>("seen", [this](const BytesValue&) { ++seen_; });
  }

  void serve() override {
    if (sent_ == kMessages) {
      report("messages", static_cast<std::int64_t>(addresses_.size()));
      source_.finish();
    } else if (seen_ == sent_) {
      first_.publish(first_.loan());
      auto image = images_.loan();
      addresses_.insert(&*image);
      images_.publish(std::move(image));
      ++sent_;
    }
  }

 private:
  static constexpr int kMessages = 200;

  Publisher<BytesValue> first_;
  Publisher<BytesValue> images_;
  Source source_;
  std::set<const BytesValue*> addresses_;
  int sent_ = 0;
  int seen_ = 0;
};

class Acknowledger final : public Component {
 public:
  explicit Acknowledger(Context& context)
      : Component(context), seen_(context.create_publisher<BytesValue>("seen")) {
    context.create_subscriber<BytesValue>(
        "images", {.depth = 16}, [this](const BytesValue&) { seen_.publish(seen_.loan()); });
  }

 private:
  Publisher<BytesValue> seen_;
};

// A pool whose messages take turns would need the memory of all.
TEST(HotPath, EachTopicOfAnActivationGetsTheMessageThatReturnedLast) {
  setenv("FASTCYCLE_POISON", "off", 1);  // Otherwise each message is made anew.
  TestClasses classes;
  classes.with<TwoTopics>("two").with<Acknowledger>("acknowledger");
  const auto application = host::make_application(R"({"name": "t", "components": [
        {"name": "two", "library": "two", "serve_period_ms": 0.5},
        {"name": "acknowledger", "library": "acknowledger"}]})",
                                                  classes);

  application->start();
  application->run(std::nullopt);
  application->stop();

  EXPECT_LE(std::get<std::int64_t>(application->components()[0]->results.at("messages")), 6);
}

}  // namespace
}  // namespace fastcycle
