// A load of benchmarks/load, as nodes of one process with intra-process communication:
//
//     load_rclcpp single|multi|events APPLICATION.json
//
// reads the application that load.py made for FastCycle, with the same parameters, and runs until
// SIGINT. Nodes have no services of their own: they would take memory and no part in the load.
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
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

#include "measure/clock.h"

namespace fastcycle::peers {
namespace {

using nlohmann::json;
using RosMessage = std_msgs::msg::UInt8MultiArray;
using Numbers = std::vector<std::int64_t>;

void compute(std::int64_t duration_ns) {
  if (duration_ns <= 0) {
    return;
  }
  const auto used_ns = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
  };
  const std::int64_t end_ns = used_ns() + duration_ns;
  while (used_ns() < end_ns) {
  }
}

/// As `LoadNode` of benchmarks/load. The message is the roots, 8 bytes each, then the payload.
class LoadNode final : public rclcpp::Node {
 public:
  explicit LoadNode(const json& component)
      : Node(component.at("name"), rclcpp::NodeOptions()
                                       .use_intra_process_comms(true)
                                       .start_parameter_services(false)
                                       .start_parameter_event_publisher(false)
                                       .enable_rosout(false)) {
    const json& params = component.at("params");
    const json& topics = component.at("remap");
    const auto topic = [&](const char* kind, std::size_t number) {
      return topics.at(kind + std::to_string(number)).get<std::string>();
    };
    params.at("samples").get_to(file_);
    params.at("computes_ns").get_to(computes_ns_);
    params.at("ends").get_to(ends_);
    roots_ns_.resize(params.at("chains"));
    ended_ns_.resize(roots_ns_.size());
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
          topic("in_", i), quality(),
          [this, cause](RosMessage::ConstSharedPtr message) { take(cause, *message); }));
    }
  }

  void write_samples() const {
    if (file_.empty()) {
      return;
    }
    std::ofstream out(file_);
    for (const auto& [chain, latency_ns] : samples_) {
      out << chain << ' ' << latency_ns << '\n';
    }
  }

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

  std::int64_t root_of(const RosMessage& message, std::size_t chain) const {
    std::int64_t root_ns = 0;
    std::memcpy(&root_ns, message.data.data() + chain * sizeof root_ns, sizeof root_ns);
    return root_ns;
  }

  void take(std::size_t cause, const RosMessage& message) {
    const std::int64_t now_ns = measure::now_ns();
    for (std::size_t i = 0; i + 1 < ends_.size(); i += 2) {
      const auto chain = static_cast<std::size_t>(ends_[i + 1]);
      const std::int64_t root_ns = root_of(message, chain);
      if (ends_[i] == static_cast<std::int64_t>(cause) && root_ns > ended_ns_.at(chain)) {
        ended_ns_[chain] = root_ns;
        samples_.emplace_back(chain, now_ns - root_ns);
      }
    }
    merge(message);
    work(cause);
  }

  void merge(const RosMessage& message) {
    for (std::size_t chain = 0; chain < roots_ns_.size(); ++chain) {
      roots_ns_[chain] = std::max(roots_ns_[chain], root_of(message, chain));
    }
  }

  void work(std::size_t cause) {
    for (const RosMessage::ConstSharedPtr& read : reads_) {
      if (read != nullptr) {
        merge(*read);
      }
    }
    compute(computes_ns_.at(cause));
    for (Output& output : outputs_) {
      if (output.cause == cause && ++output.count % output.each == 0) {
        publish(output);
      }
    }
  }

  void publish(Output& output) {
    auto message = std::make_unique<RosMessage>();
    message->data.resize(roots_ns_.size() * sizeof(std::int64_t) + output.bytes);
    if (!roots_ns_.empty()) {
      std::memcpy(message->data.data(), roots_ns_.data(), roots_ns_.size() * sizeof(std::int64_t));
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
  Numbers ends_;
  std::vector<Output> outputs_;
  std::vector<RosMessage::ConstSharedPtr> reads_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  std::vector<rclcpp::TimerBase::SharedPtr> timers_;
  std::vector<std::int64_t> roots_ns_;
  std::vector<std::int64_t> ended_ns_;
  std::vector<std::pair<std::size_t, std::int64_t>> samples_;
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
