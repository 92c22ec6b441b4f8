// A load of benchmarks/load, as nodes of one process with intra-process communication:
//
//     load_rclcpp single|multi|events APPLICATION.json
//
// reads the application that load.py made for FastCycle, with the same parameters, and runs until
// SIGINT. Nodes have no services of their own: they would take memory and no part in the load.
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <rclcpp/experimental/executors/events_executor/events_executor.hpp>
#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/u_int8_multi_array.hpp>

#include "load/chains.h"
#include "measure/clock.h"

namespace fastcycle::peers {
namespace {

using nlohmann::json;
using RosMessage = std_msgs::msg::UInt8MultiArray;
using Numbers = std::vector<std::int64_t>;

/// The root of each chain in `message`.
auto roots_of(const RosMessage& message) {
  return [&message](std::size_t chain) {
    std::int64_t root_ns = 0;
    std::memcpy(&root_ns, message.data.data() + chain * sizeof root_ns, sizeof root_ns);
    return root_ns;
  };
}

/// As `LoadNode` of benchmarks/load. The message is the roots, 8 bytes each, then the payload.
class LoadNode final : public rclcpp::Node {
 public:
  explicit LoadNode(const json& component)
      : Node(component.at("name"), rclcpp::NodeOptions()
                                       .use_intra_process_comms(true)
                                       .start_parameter_services(false)
                                       .start_parameter_event_publisher(false)
                                       .enable_rosout(false)),
        chains_(component.at("params").at("chains"),
                component.at("params").at("ends").get<Numbers>()) {
    const json& params = component.at("params");
    const json& topics = component.at("remap");
    const auto topic = [&](const char* kind, std::size_t number) {
      return topics.at(kind + std::to_string(number)).get<std::string>();
    };
    params.at("samples").get_to(file_);
    params.at("computes_ns").get_to(computes_ns_);
    const auto bytes = params.at("bytes").get<Numbers>();
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      outputs_.push_back({.publisher = create_publisher<RosMessage>(topic("out_", i), quality()),
                          .bytes = static_cast<std::size_t>(bytes[i]),
                          .cause = params.at("causes").at(i),
                          .each = params.at("each").at(i),
                          .begins = params.at("begins").at(i)});
    }
    reads_.resize(params.at("reads"));
    for (std::size_t i = 0; i < reads_.size(); ++i) {
      subscriptions_.push_back(create_subscription<RosMessage>(
          topic("read_", i), rclcpp::QoS(1),
          [this, i](RosMessage::ConstSharedPtr message) { reads_[i] = std::move(message); }));
    }
    std::size_t cause = 0;
    for (const std::int64_t period_us : params.at("periods_us").get<Numbers>()) {
      timers_.push_back(
          create_wall_timer(std::chrono::microseconds(period_us), [this, cause] { work(cause); }));
      ++cause;
    }
    const std::size_t inputs = params.at("inputs");
    for (std::size_t i = 0; i < inputs; ++i, ++cause) {
      subscriptions_.push_back(create_subscription<RosMessage>(
          topic("in_", i), quality(), [this, cause](RosMessage::ConstSharedPtr message) {
            chains_.arrived(cause, roots_of(*message));
            work(cause);
          }));
    }
  }

  void write_samples() const { chains_.write(file_); }

 private:
  struct Output {
    rclcpp::Publisher<RosMessage>::SharedPtr publisher;
    std::size_t bytes = 0;
    std::size_t cause = 0;
    std::int64_t each = 1;
    std::int64_t begins = -1;
    std::int64_t count = 0;
  };

  static rclcpp::QoS quality() { return rclcpp::QoS(16); }  // FastCycle's depth.

  void work(std::size_t cause) {
    for (const RosMessage::ConstSharedPtr& read : reads_) {
      if (read != nullptr) {
        chains_.depend_on(roots_of(*read));
      }
    }
    load::compute(computes_ns_.at(cause));
    for (Output& output : outputs_) {
      if (output.cause == cause && ++output.count % output.each == 0) {
        publish(output);
      }
    }
  }

  void publish(Output& output) {
    auto message = std::make_unique<RosMessage>();
    const Numbers& roots_ns = chains_.roots_ns();
    const std::size_t head = roots_ns.size() * sizeof(std::int64_t);
    message->data.resize(head + output.bytes);
    if (head > 0) {
      std::memcpy(message->data.data(), roots_ns.data(), head);
    }
    if (output.begins >= 0) {
      const std::int64_t now_ns = measure::now_ns();
      std::memcpy(message->data.data() + static_cast<std::size_t>(output.begins) * sizeof now_ns,
                  &now_ns, sizeof now_ns);
    }
    output.publisher->publish(std::move(message));
  }

  std::string file_;
  Numbers computes_ns_;
  load::Chains chains_;
  std::vector<Output> outputs_;
  std::vector<RosMessage::ConstSharedPtr> reads_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  std::vector<rclcpp::TimerBase::SharedPtr> timers_;
};

std::unique_ptr<rclcpp::Executor> executor_of(const std::string& name, std::size_t workers) {
  if (name == "single") {
    return std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
  }
  if (name == "multi") {
    return std::make_unique<rclcpp::executors::MultiThreadedExecutor>(rclcpp::ExecutorOptions(),
                                                                      workers);
  }
  if (name == "events") {
    return std::make_unique<rclcpp::experimental::executors::EventsExecutor>();
  }
  throw std::runtime_error("expected single, multi or events, found " + name);
}

void run(const std::string& executor_name, const std::string& file) {
  const json application = json::parse(std::ifstream(file));
  const std::unique_ptr<rclcpp::Executor> executor =
      executor_of(executor_name, application.at("executors").at(0).at("threads"));
  std::vector<std::shared_ptr<LoadNode>> nodes;
  for (const json& component : application.at("components")) {
    nodes.push_back(std::make_shared<LoadNode>(component));
    executor->add_node(nodes.back());
  }
  executor->spin();
  for (const std::shared_ptr<LoadNode>& node : nodes) {
    node->write_samples();
  }
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: load_rclcpp single|multi|events APPLICATION.json\n", stderr);
    return 2;
  }
  try {
    rclcpp::init(1, argv);
    fastcycle::peers::run(argv[1], argv[2]);
    rclcpp::shutdown();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "load_rclcpp: %s\n", error.what());
    return 1;
  }
  return 0;
}
