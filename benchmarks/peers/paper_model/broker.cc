#include "peers/paper_model/broker.h"

#include <utility>

namespace fastcycle::peers::paper_model {

Broker::Broker(Looking looking, unsigned threads)
    : looking_(looking), pool_(threads), main_thread_([this] { run_main_thread(); }) {}

Broker::~Broker() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  is_changed_.notify_one();
  main_thread_.join();
}

void Broker::subscribe(const std::string& topic, Callback callback) {
  const std::lock_guard lock(mutex_);
  topics_[topic].push_back(std::make_unique<Subscription>(std::move(callback)));
}

void Broker::publish(const std::string& topic, Message message) {
  for (const auto& subscription : topics_.at(topic)) {
    const std::lock_guard lock(subscription->mutex);
    subscription->queue.push_back(message);
  }
  if (looking_ == Looking::kWhenNotified) {
    {
      const std::lock_guard lock(mutex_);
      has_news_ = true;
    }
    is_changed_.notify_one();
  }
}

void Broker::run_main_thread() {
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    if (looking_ == Looking::kEvery100us) {
      look();
      lock.unlock();
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      lock.lock();
    } else {
      is_changed_.wait(lock, [this] { return has_news_ || is_stopping_; });
      has_news_ = false;
      lock.unlock();  // Publishers continue in the meantime.
      look();
      lock.lock();
    }
  }
}

void Broker::look() {
  for (const auto& [topic, subscriptions] : topics_) {
    for (const auto& subscription : subscriptions) {
      while (auto message = take(*subscription)) {
        pool_.submit(
            [&callback = subscription->callback, kept = std::move(*message)] { callback(kept); });
      }
    }
  }
}

std::optional<Message> Broker::take(Subscription& subscription) {
  const std::lock_guard lock(subscription.mutex);
  if (subscription.queue.empty()) {
    return std::nullopt;
  }
  Message message = std::move(subscription.queue.front());
  subscription.queue.pop_front();
  return message;
}

}  // namespace fastcycle::peers::paper_model
