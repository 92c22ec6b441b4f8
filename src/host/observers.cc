#include "host/observers.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "component/time_driver.h"

namespace fastcycle::host {

namespace {

/// Notifies observers of full queues.
class OverflowNotifier final : public detail::OverflowWatch {
 public:
  explicit OverflowNotifier(std::vector<Observer*> observers) : observers_(std::move(observers)) {}

  void overflowed(const detail::Subscription& subscription) noexcept override {
    for (Observer* observer : observers_) {
      observer->overflowed(subscription);
    }
  }

 private:
  const std::vector<Observer*> observers_;
};

}  // namespace

void Observers::add(std::unique_ptr<Observer> observer) {
  owned_.push_back(std::move(observer));
  add(*owned_.back());
}

void Observers::tap(detail::Topics& topics) {
  std::ranges::copy_if(observers_, std::back_inserter(change_observers_),
                       [](const Observer* observer) { return observer->wants_changes(); });
  for (Observer* observer : observers_) {
    observer->tap(topics);
  }
  std::vector<Observer*> counting;
  std::ranges::copy_if(observers_, std::back_inserter(counting),
                       [](const Observer* observer) { return observer->wants_overflows(); });
  if (!counting.empty()) {
    overflow_watch_ = std::make_unique<OverflowNotifier>(std::move(counting));
    topics.set_overflow_watch(*overflow_watch_);
  }
}

bool Observers::want_reads() const {
  return std::ranges::any_of(observers_,
                             [](const Observer* observer) { return observer->wants_reads(); });
}

void Observers::open(config::Problems& problems) {
  for (Observer* observer : observers_) {
    observer->open(problems);
  }
}

void Observers::start(const Application& application, TimeDriver& time,
                      std::vector<const detail::ReadRing*> reads,
                      std::vector<const detail::PeerActivity*> peers,
                      std::vector<base::Refusal>& refusals) {
  if (observers_.empty()) {
    return;
  }
  time.after_round([this](std::uint32_t step) {
    if (is_over_) {
      return;
    }
    for (Observer* observer : observers_) {
      observer->round_ended(step);
    }
  });
  const ObserverView view{.application = application,
                          .rings = time.rings(),
                          .reads = std::move(reads),
                          .peers = std::move(peers)};
  for (Observer* observer : observers_) {
    observer->start(view, refusals);
  }
}

void Observers::faulted(std::string_view component, std::string_view what) noexcept {
  if (is_over_) {
    return;
  }
  for (Observer* observer : observers_) {
    observer->faulted(component, what);
  }
}

void Observers::changed(const ComponentNews& news) noexcept {
  if (is_over_) {
    return;
  }
  for (Observer* observer : change_observers_) {
    observer->changed(news);
  }
}

void Observers::changed_elsewhere(const ComponentNews& news) noexcept {
  changed(news);
  if (is_over_) {
    return;
  }
  for (Observer* observer : observers_) {
    observer->changed_elsewhere(news);
  }
}

void Observers::stop(const Application& application) {
  is_over_ = true;
  for (Observer* observer : observers_) {
    observer->stop(application);
  }
}

}  // namespace fastcycle::host
