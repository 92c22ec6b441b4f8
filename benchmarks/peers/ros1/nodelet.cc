#include <map>
#include <string>

#include <nodelet/loader.h>
#include <nodelet/nodelet.h>

#include "peers/ros1/node.h"
#include "peers/ros1/variants.h"

namespace fastcycle::peers {
namespace {

/// Records messages of `topic`, or forwards them to "echo". The manager calls it in one of its
/// worker threads.
class Receiver final : public nodelet::Nodelet {
 public:
  Receiver(Run& run, const char* topic, bool is_echoing)
      : run_(run), topic_(topic), is_echoing_(is_echoing) {}

 private:
  void onInit() override {
    ros::NodeHandle& node = getNodeHandle();
    if (is_echoing_) {
      echo_ = node.advertise<RosPayload>("echo", kQueue);
    }
    subscriber_ = node.subscribe(topic_, kQueue, &Receiver::receive, this);
  }

  void receive(const RosPayload::ConstPtr& payload) {
    const std::int64_t arrived_ns = now_ns();
    if (is_echoing_) {
      echo_.publish(payload);  // The same message: no copy.
    } else {
      take_down(run_, payload, arrived_ns);
    }
  }

  Run& run_;
  const std::string topic_;
  const bool is_echoing_;
  ros::Publisher echo_;
  ros::Subscriber subscriber_;
};

/// Publishes from its own thread, which here is the main thread.
class Sender final : public nodelet::Nodelet {
 public:
  [[nodiscard]] const ros::Publisher& publisher() const { return publisher_; }

 private:
  void onInit() override { publisher_ = getNodeHandle().advertise<RosPayload>("payload", kQueue); }

  ros::Publisher publisher_;
};

}  // namespace

void measure_nodelet(Run& run) {
  init_node("manager");
  ros::NodeHandle keeps_ros_running;
  const auto sender = boost::make_shared<Sender>();
  // The manager that a launch file would start, with its thread pool; nodelets are created by a
  // function instead of plug-in libraries.
  nodelet::Loader manager([&](const std::string& type) -> boost::shared_ptr<nodelet::Nodelet> {
    if (type == "sender") {
      return sender;
    }
    return boost::make_shared<Receiver>(run, type == "last" ? "echo" : "payload", type == "echo");
  });
  const auto load = [&](const char* type) {
    if (!manager.load(std::string("/") + type, type, {}, {})) {
      throw std::runtime_error(std::string("cannot load the nodelet ") + type);
    }
  };
  load("sender");
  if (run.is_rtt()) {
    load("echo");
    load("last");
  } else {
    load("receiver");
  }
  wait_for_subscriber(sender->publisher());
  publish_all(run, sender->publisher());
  manager.clear();
  ros::shutdown();
}

}  // namespace fastcycle::peers
