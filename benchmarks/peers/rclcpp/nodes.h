#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include <rclcpp/rclcpp.hpp>

#include "peers/common/run.h"
#include "peers/common/wait.h"
#include "peers/rclcpp/message.h"

namespace fastcycle::peers {

/// The context of this process, from the first node to the last.
class Ros {
 public:
  Ros() { rclcpp::init(0, nullptr, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None); }
  Ros(const Ros&) = delete;
  Ros& operator=(const Ros&) = delete;
  ~Ros() { rclcpp::shutdown(); }
};

/// Spins in a separate thread.
class Spinner {
 public:
  explicit Spinner(rclcpp::Executor& executor)
      : executor_(executor), thread_([&executor] { executor.spin(); }) {}
  Spinner(const Spinner&) = delete;
  Spinner& operator=(const Spinner&) = delete;
  ~Spinner() {
    executor_.cancel();
    thread_.join();
  }

 private:
  rclcpp::Executor& executor_;
  std::thread thread_;
};

/// Reliable, with a queue for a window of a flood. Intra-process delivery requires a bounded
/// KEEP_LAST.
inline rclcpp::QoS quality() {
  return rclcpp::QoS(rclcpp::KeepLast(2 * static_cast<std::size_t>(Run::kWindow))).reliable();
}

inline void wait_for_subscriber(const rclcpp::Publisher<RosMessage>& publisher) {
  wait_until(std::string("somebody subscribes to ") + publisher.get_topic_name(),
             [&] { return publisher.get_subscription_count() > 0; });
}

/// Records messages of a topic: by shared pointer to const, for which rclcpp copies neither within
/// a process nor after deserialization.
class Receiver final : public rclcpp::Node {
 public:
  Receiver(const rclcpp::NodeOptions& options, Run& run, const char* topic)
      : Node("receiver", options) {
    subscription_ = create_subscription<RosMessage>(topic, quality(),
                                                    [&run](RosMessage::ConstSharedPtr message) {
                                                      const std::int64_t arrived_ns = now_ns();
                                                      take_down(run, *message, arrived_ns);
                                                    });
  }

 private:
  rclcpp::Subscription<RosMessage>::SharedPtr subscription_;
};

/// Forwards what arrives. Within a process it takes ownership of the message and passes it on.
class Echo final : public rclcpp::Node {
 public:
  explicit Echo(const rclcpp::NodeOptions& options) : Node("echo", options) {
    publisher_ = create_publisher<RosMessage>("echo", quality());
    if (options.use_intra_process_comms()) {
      subscription_ = create_subscription<RosMessage>(
          "payload", quality(),
          [this](RosMessage::UniquePtr message) { publisher_->publish(std::move(message)); });
    } else {
      subscription_ = create_subscription<RosMessage>(
          "payload", quality(),
          [this](RosMessage::ConstSharedPtr message) { publisher_->publish(*message); });
    }
  }

  [[nodiscard]] const rclcpp::Publisher<RosMessage>& publisher() const { return *publisher_; }

 private:
  rclcpp::Publisher<RosMessage>::SharedPtr publisher_;
  rclcpp::Subscription<RosMessage>::SharedPtr subscription_;
};

/// Publishes all messages of the run, each with its ownership: "publish a unique_ptr" (tutorial on
/// efficient intra-process communication).
class Sender final : public rclcpp::Node {
 public:
  explicit Sender(const rclcpp::NodeOptions& options) : Node("sender", options) {
    publisher_ = create_publisher<RosMessage>("payload", quality());
  }

  void publish_all(Run& run) {
    wait_for_subscriber(*publisher_);
    run.publish_all(
        [&](std::int64_t number) { publisher_->publish(make_message(run.size(), number)); });
  }

 private:
  rclcpp::Publisher<RosMessage>::SharedPtr publisher_;
};

}  // namespace fastcycle::peers
