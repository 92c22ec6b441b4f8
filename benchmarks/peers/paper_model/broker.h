#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include <google/protobuf/message.h>

#include "peers/paper_model/thread_pool.h"

namespace fastcycle::peers::paper_model {

using Message = std::shared_ptr<const google::protobuf::Message>;
using Callback = std::function<void(const Message&)>;

/// How the main thread detects new messages.
enum class Looking : std::uint8_t {
  kEvery100us,   ///< It polls, and sleeps 100 us in between.
  kWhenNotified  ///< It sleeps until a publisher notifies it.
};

/// The design of the paper: a hash map from topic to the queues of its subscribers, a main thread
/// that detects newly published messages, and a thread pool to which it submits the callbacks.
class Broker {
 public:
  Broker(Looking looking, unsigned threads);
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;
  ~Broker();

  /// Call it before the first message is published.
  void subscribe(const std::string& topic, Callback callback);
  void publish(const std::string& topic, Message message);

 private:
  struct Subscription {
    explicit Subscription(Callback called) : callback(std::move(called)) {}

    const Callback callback;
    std::mutex mutex;
    std::deque<Message> queue;
  };

  void run_main_thread();
  /// Submits the callbacks of all queued messages.
  void look();
  [[nodiscard]] std::optional<Message> take(Subscription& subscription);

  const Looking looking_;
  std::unordered_map<std::string, std::vector<std::unique_ptr<Subscription>>> topics_;
  std::mutex mutex_;
  std::condition_variable is_changed_;
  bool has_news_ = false;
  bool is_stopping_ = false;
  ThreadPool pool_;
  std::thread main_thread_;
};

}  // namespace fastcycle::peers::paper_model
