#include "host/log_topic.h"

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "base/clock.h"
#include "base/utf8.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/own_names.h"
#include "host/status.h"

namespace fastcycle::host {
namespace {

using namespace std::chrono_literals;
using AllKept = detail::LogSource::AllKept;
using State = detail::ComponentCore::State;

constexpr Duration kWindow = 100ms;

}  // namespace

LogComponent::LogComponent(Context& context)
    : Component(context),
      lines_(context.create_publisher<status::LogLine>(std::string("/") + kLogTopic)) {}

void LogComponent::publish() {
  const AllKept kept = feed_->take();
  lost_ += kept.lost;
  for (const detail::LogSource::Kept& line : kept.lines) {
    if (now() >= window_begin_ + kWindow) {
      window_begin_ = now();
      count_ = 0;
    }
    if (count_ == kMostLines) {
      ++lost_;
      continue;
    }
    ++count_;
    auto message = lines_.loan();
    message->mutable_header()->set_taken_ns(base::to_ns(line.time));
    message->set_level(static_cast<status::LogLevel>(line.level));
    message->set_component(line.component);
    message->set_text(base::to_utf8(line.text));
    message->set_lost(std::exchange(lost_, 0));
    lines_.publish(std::move(message));
  }
}

LogFeed::LogFeed(ApplicationHost& application, detail::ComponentCore& core)
    : application_(application), core_(core) {
  static_cast<LogComponent*>(core.component)->set_feed(*this);
}

AllKept LogFeed::take() {
  const std::lock_guard lock(mutex_);
  is_asked_ = false;
  return std::exchange(waiting_, {});
}

void LogFeed::start(const ObserverView&, std::vector<base::Refusal>&) {
  if (!application_.clock().is_simulated()) {
    application_.log_queue().set_listener(this, [this](const detail::LogLine& line) {
      add({.time = line.time,
           .level = line.level,
           .component = std::string(line.component),
           .text = std::string(line.text)});
      ask();
    });
    return;
  }
  application_.own_log().keep();
  for (const auto& component : application_.components()) {
    component->log_source.keep();
  }
}

void LogFeed::add(detail::LogSource::Kept line) {
  const std::lock_guard lock(mutex_);
  if (waiting_.lines.size() == detail::LogSource::kMostKept) {
    ++waiting_.lost;
  } else {
    waiting_.lines.push_back(std::move(line));
  }
}

/// Before its start it takes them when it starts, and after its stop they are not needed.
void LogFeed::ask() {
  {
    const std::lock_guard lock(mutex_);
    const bool is_empty = waiting_.lines.empty() && waiting_.lost == 0;
    if (is_empty || is_asked_ || core_.state != State::kActive) {
      return;
    }
    is_asked_ = true;
  }
  core_.post(detail::Cause::kEvent, [&core = core_] {
    if (core.state == State::kActive) {
      static_cast<LogComponent*>(core.component)->publish();
    }
  });
}

void LogFeed::round_ended(std::uint32_t) {
  const auto gather = [this](detail::LogSource& source) {
    AllKept kept = source.take_kept();
    // The order of FastCycle's own lines within a round depends on the workers.
    std::multimap<std::string, detail::LogSource::Kept> by_component;
    for (detail::LogSource::Kept& line : kept.lines) {
      std::string component = line.component;
      by_component.emplace(std::move(component), std::move(line));
    }
    for (auto& [component, line] : by_component) {
      add(std::move(line));
    }
    const std::lock_guard lock(mutex_);
    waiting_.lost += kept.lost;
  };
  gather(application_.own_log());
  for (const auto& component : application_.components()) {
    gather(component->log_source);
  }
  ask();
}

void LogFeed::stop(const Application&) {
  application_.log_queue().set_listener(this, {});
}

config::ComponentDescription describe_log(const config::ApplicationDescription& application) {
  config::ComponentDescription description = describe_status(application);
  description.name = kLogName;
  return description;
}

const ComponentClass& log_class() {
  static constexpr ComponentClass kClass{"Log", &fastcycle::detail::create_component<LogComponent>,
                                         &fastcycle::detail::destroy_component<LogComponent>};
  return kClass;
}

}  // namespace fastcycle::host
