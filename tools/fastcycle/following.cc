#include "following.h"

#include <condition_variable>
#include <cstdlib>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "broker/publisher_core.h"
#include "broker/topic.h"
#include "command.h"
#include "print.h"
#include "report/changes.h"

namespace fastcycle::tool {

using nlohmann::ordered_json;

namespace {

constexpr std::chrono::milliseconds kPeriod{200};

}  // namespace

Following::Following(const processes::ProcessPlan& plan, processes::Partition& partition,
                     host::Application& application, std::string command)
    : plan_(plan),
      partition_(partition),
      application_(application),
      command_(std::move(command)),
      name_(plan.name(partition.process())),
      is_shadow_(plan.shadow_in(partition.process()) != nullptr) {}

standby::Follower::Listener Following::listener() {
  standby::Follower::Listener listener;
  listener.in_step = [this] {
    {
      const std::lock_guard lock(mutex_);
      stage_ = Stage::kInStep;
    }
    application_.log(LogLevel::kInfo, {},
                     is_shadow_ ? fmt::format("process \"{}\" follows \"{}\" as its shadow", name_,
                                              plan_.shadow_in(partition_.process())->of)
                                : fmt::format("process \"{}\" is on standby, in its run {}", name_,
                                              partition_.incarnation()));
  };
  listener.lost = [this](const std::string& why) {
    // The process is restarted if the application asks for it; its state is not worth an orderly
    // end.
    print_to(stderr, "fastcycle {}: process \"{}\" cannot {}: {}\n", command_, name_,
             is_shadow_ ? "follow" : "be on standby", why);
    std::_Exit(kFailed);
  };
  listener.taken_over = [this](std::int64_t duration_ns) {
    {
      const std::lock_guard lock(mutex_);
      stage_ = Stage::kHasTakenOver;
    }
    application_.log(
        LogLevel::kWarning, {},
        fmt::format(
            "process \"{}\" has taken over, {:.3f} ms after it detected the end of the other one",
            name_, static_cast<double>(duration_ns) / 1e6));
  };
  if (is_shadow_) {
    listener.compare = [this](const auto& publisher, const auto& theirs, const auto& own,
                              bool is_equal) { compare(publisher, theirs, own, is_equal); };
    listener.unmatched = [this](const detail::PublisherCore& publisher, bool is_theirs) {
      const std::lock_guard lock(mutex_);
      host::TopicChange& change = output_of(publisher).change;
      ++(is_theirs ? change.missing : change.added);
    };
    listener.not_compared = [this](const detail::PublisherCore& publisher) {
      const std::lock_guard lock(mutex_);
      ++output_of(publisher).change.not_compared;
    };
  }
  return listener;
}

/// The mutex is held.
Following::Output& Following::output_of(const detail::PublisherCore& publisher) {
  Output& output = outputs_[publisher.id];
  output.change.topic = publisher.topic.name;
  output.change.publisher = publisher.owner.name;
  return output;
}

void Following::compare(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
                        const detail::Envelope& own, bool is_equal) {
  const std::lock_guard lock(mutex_);
  Output& output = output_of(publisher);
  ++output.change.compared;
  if (!is_equal) {
    ++output.change.different;
    output.fields.add(
        *theirs.payload, *own.payload,
        {.time_ns = base::to_ns(theirs.info.publish_time), .sequence = theirs.info.sequence});
  }
}

/// The mutex is held.
std::vector<host::TopicChange> Following::topics() const {
  std::vector<host::TopicChange> topics;
  for (const auto& [id, output] : outputs_) {
    topics.push_back(output.change);
    topics.back().fields = output.fields.all();
  }
  return topics;
}

std::string Following::in_json() const {
  const standby::Follower* const follower = partition_.follower();
  const standby::Follower::Progress progress =
      follower == nullptr ? standby::Follower::Progress{} : follower->progress();
  const std::lock_guard lock(mutex_);
  const char* const state = follower == nullptr || stage_ == Stage::kHasTakenOver ? "active"
                            : stage_ == Stage::kInStep                            ? "in step"
                                                       : "seeks a key frame";
  ordered_json json = {{"process", name_},
                       {"kind", is_shadow_ ? "shadow" : "standby"},
                       {"state", state},
                       {"run", partition_.incarnation()},
                       {"activations", progress.executed},
                       {"behind", progress.known - std::min(progress.known, progress.executed)},
                       {"compared", progress.compared}};
  if (is_shadow_) {
    json["of"] = plan_.shadow_in(partition_.process())->of;
    json["topics"] = host::json_of(topics(), base::to_ns(application_.start_time()));
  }
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

void Following::send() {
  std::string text = in_json();
  if (text == reported_) {
    return;
  }
  try {
    partition_.send_notice(host::Notice::Kind::kFollows, 0, text);
  } catch (const std::length_error&) {  // It has thousands of fields: the report has them.
    return;
  }
  reported_ = std::move(text);
}

void Following::begin() {
  thread_ = std::jthread([this](const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any is_to_end;
    std::unique_lock lock(mutex);
    while (!stop.stop_requested()) {
      send();
      is_to_end.wait_for(lock, stop, kPeriod, [] { return false; });
    }
  });
}

void Following::end() {
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
  }
}

std::vector<host::ToolReport> Following::report() const {
  if (!is_shadow_) {
    return {};
  }
  const std::lock_guard lock(mutex_);
  const std::int64_t begin_ns = base::to_ns(application_.start_time());
  const std::string& of = plan_.shadow_in(partition_.process())->of;
  const ordered_json json = {{"of", of}, {"topics", host::json_of(topics(), begin_ns)}};
  return {{.name = name_,
           .json = json.dump(),
           .table = fmt::format("\nshadow \"{}\" of \"{}\"\n{}", name_, of,
                                host::table_of(topics(), begin_ns))}};
}

}  // namespace fastcycle::tool
