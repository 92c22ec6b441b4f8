#include <rclcpp/experimental/executors/events_executor/events_executor.hpp>

#include "peers/rclcpp/nodes.h"
#include "peers/rclcpp/variants.h"

namespace fastcycle::peers {
namespace {

/// Nodes composed in one container, with `use_intra_process_comms`: a message that is published and
/// taken as a unique_ptr is not copied.
void measure_intra(Run& run, rclcpp::Executor& executor) {
  const auto options = rclcpp::NodeOptions().use_intra_process_comms(true);
  const auto sender = std::make_shared<Sender>(options);
  const auto receiver = std::make_shared<Receiver>(options, run, run.is_rtt() ? "echo" : "payload");
  std::shared_ptr<Echo> echo;
  executor.add_node(sender);
  executor.add_node(receiver);
  if (run.is_rtt()) {
    echo = std::make_shared<Echo>(options);
    executor.add_node(echo);
    wait_for_subscriber(echo->publisher());
  }
  const Spinner spinner(executor);
  sender->publish_all(run);
}

}  // namespace

void measure_intra_multithreaded(Run& run) {
  const Ros ros;
  rclcpp::executors::MultiThreadedExecutor executor;
  measure_intra(run, executor);
}

void measure_intra_events(Run& run) {
  const Ros ros;
  rclcpp::experimental::executors::EventsExecutor executor;
  measure_intra(run, executor);
}

}  // namespace fastcycle::peers
