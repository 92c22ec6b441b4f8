#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "record/recorded_schedule.h"
#include "replay/field_changes.h"
#include "replay/output_listener.h"

namespace fastcycle::host {

/// Compares what components publish in an `ExactReplay` with what was recorded, field by field.
///
///     DriveComparison comparison(schedule);
///     replay.listener = &comparison;
///     replay.run(watcher);
///     comparison.finish();
///     for (const TopicChange& topic : comparison.topics()) { … }
///
/// A new message is paired with the recorded one that the same activation published on the same
/// topic: the first with the first, and so on. So an additional or missing message shifts none of
/// the others. A recorded message belongs to the last activation that had begun when it was
/// published.
///
/// Memory: the messages that only one side has reached.
class DriveComparison final : public OutputListener {
 public:
  /// `schedule` has to outlive this.
  explicit DriveComparison(const record::RecordedSchedule& schedule) : schedule_(schedule) {}

  /// A message published in the replay. `publish_time` is that of its recorded counterpart; without
  /// one, the time of its activation.
  struct NewMessage {
    const detail::PublisherCore& publisher;
    std::int64_t publish_time_ns;
    std::uint64_t sequence;
    std::string_view bytes;
  };
  /// Called for each, in order per publisher.
  std::function<void(const NewMessage& message)> on_new_message;

  void is_recorded(const detail::PublisherCore& publisher, const MessageInfo& info,
                   std::string_view bytes) override;
  void is_published(const detail::PublisherCore& publisher, const Source& source,
                    std::uint64_t sequence, std::string_view bytes) override;
  void has_executed(const std::string& component, std::int64_t time_ns) override;

  /// After the run: unpaired messages have no counterpart.
  void finish();

  /// By topic and publisher; fields in the order of the number of messages, largest first.
  [[nodiscard]] std::vector<TopicChange> topics() const;

 private:
  struct Recorded {
    std::int64_t activation_time_ns;
    std::int64_t publish_time_ns;
    std::uint64_t sequence;
    std::string bytes;
  };
  struct Published {
    std::int64_t activation_time_ns;
    std::uint64_t activation;
    std::uint64_t sequence;
    std::string bytes;
  };
  /// Messages of one publisher, not paired yet.
  struct Lane {
    const detail::PublisherCore* publisher = nullptr;
    const record::RecordedSchedule::Component* component = nullptr;  ///< Null: not in the log.
    std::deque<Recorded> recorded;
    std::deque<Published> published;
    TopicChange change;
    FieldChanges fields;
  };

  Lane& lane_of(const detail::PublisherCore& publisher);
  [[nodiscard]] std::optional<std::int64_t> executed_ns(const Lane& lane) const;
  void match(Lane& lane);
  void add(Lane& lane);
  void compare(Lane& lane, const Recorded& recorded, const Published& published);

  const record::RecordedSchedule& schedule_;
  std::map<PublisherId, Lane> lanes_;
  /// By component, also of those without a lane yet: up to this time.
  std::map<std::string, std::int64_t> executed_ns_;
};

}  // namespace fastcycle::host
