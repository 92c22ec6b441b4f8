#include <rclcpp/experimental/executors/events_executor/events_executor.hpp>

#include "peers/rclcpp/nodes.h"
#include "peers/rclcpp/variants.h"

namespace fastcycle::peers {
namespace {

using rclcpp::experimental::executors::EventsExecutor;

void receive_in_second_process(Run& run) {
  const Ros ros;
  const rclcpp::NodeOptions options;
  EventsExecutor executor;
  std::shared_ptr<Receiver> receiver;
  std::shared_ptr<Echo> echo;
  if (run.is_rtt()) {
    echo = std::make_shared<Echo>(options);
    executor.add_node(echo);
    wait_for_subscriber(echo->publisher());
  } else {
    receiver = std::make_shared<Receiver>(options, run, "payload");
    executor.add_node(receiver);
  }
  const Spinner spinner(executor);
  run.set_second_ready();
  while (!run.is_over()) {
    measure::sleep_until(now_ns() + 10'000'000);
  }
}

}  // namespace

void measure_inter(Run& run) {
  run.in_second_process([&] { receive_in_second_process(run); });
  const Ros ros;
  const rclcpp::NodeOptions options;
  EventsExecutor executor;
  const auto sender = std::make_shared<Sender>(options);
  executor.add_node(sender);
  std::shared_ptr<Receiver> receiver;
  if (run.is_rtt()) {
    receiver = std::make_shared<Receiver>(options, run, "echo");
    executor.add_node(receiver);
  }
  const Spinner spinner(executor);
  run.wait_for_second_ready();
  sender->publish_all(run);
}

}  // namespace fastcycle::peers
