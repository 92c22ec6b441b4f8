#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/priority_mutex.h"
#include "broker/credits.h"
#include "broker/followed_outputs.h"
#include "broker/inbox.h"
#include "broker/lane_gate.h"
#include "broker/message_export.h"
#include "broker/pool.h"
#include "broker/pool_shares.h"
#include "broker/publishing_component.h"
#include "broker/subscription.h"
#include "fastcycle/publisher.h"

namespace fastcycle::detail {

class Topic;
class WakeList;

/// Metadata of a message from another application, in the time of this one.
struct Arrival {
  Time published{};
  Origin origin{};
  Time came{};                         ///< When it arrived here.
  std::span<const Trail> trails = {};  ///< One for each root of this application, or none.
  std::uint64_t lost = 0;              ///< Messages sent right before it that never arrived.
};

/// One component's end of a topic: numbers its messages and puts them into the lanes.
///
/// @threads  Confined to the owner's activations; `connect` to the control thread before the start.
///           An external publisher's functions take its mutex.
/// @realtime After warm-up no allocation, no lock (an external one takes its own), no hash, no
/// string;
///           at most one wake call per executor concerned, after all pushes.
class PublisherCore {
 public:
  struct Options {
    bool is_external = false;
    std::size_t keep = 0;  ///< Messages that components keep on purpose.
    /// Maximum number of messages; 0: twice what the subscribers need, plus 64. No limit in
    /// simulated time: the number held by observers and foreign threads depends on their speed, and
    /// losses must not.
    std::size_t pool_max = 0;
    std::size_t latched = 0;                ///< Messages kept for later subscribers.
    std::optional<Duration> lifespan = {};  ///< Older ones are not given to them.
  };

  PublisherCore(Topic& topic, PublishingComponent& owner, PublisherId id,
                const google::protobuf::Message& default_instance,
                const google::protobuf::Message* prototype, const Options& options);
  PublisherCore(const PublisherCore&) = delete;
  PublisherCore& operator=(const PublisherCore&) = delete;
  ~PublisherCore();

  /// Enables counting of the samples that each of `count` subscriptions of the topic keeps, and a
  /// few more that may be added while it runs. Before anything is published.
  void distinguish_holders(std::size_t count);
  /// How many of its messages the component of a subscription keeps beyond its callbacks. Safe.
  [[nodiscard]] std::size_t kept_by(Holder holder) const noexcept {
    return pool_->kept_by(holder) + forwards_->kept_by(holder);
  }

  /// Connects `lane`, which first receives the latched messages.
  void connect(const std::shared_ptr<Lane>& lane, Inbox& inbox);
  /// Adds an export to another process: messages are allocated in memory that it can read. Before
  /// anything is published, or as `publish`.
  void add_export(MessageExport& to);
  /// Gives `to`, one of these, the last latched messages, at most `count`; as `publish`.
  void give_latched(MessageExport& to, std::size_t count) noexcept;
  /// For an import: puts a message of the publisher that this represents, with its metadata, into
  /// the lanes. A gap between its sequence and that of the previous message is counted as lost.
  /// `may_repeat`: messages received before are skipped, since a standby that takes over publishes
  /// again what may be missing. Under the mutex.
  void publish_imported(Envelope* envelope, bool may_repeat) noexcept;
  /// Counts `count` more of them as lost on the way. Under its mutex.
  void lose_imported(std::uint64_t count) noexcept;
  /// The same for a publisher that is not trusted: a loan of this, with a copy of its message.
  /// Under the mutex.
  void publish_copied(Envelope* loan, const MessageInfo& info,
                      std::span<const Trail> trails) noexcept;
  /// `lane` is closed and receives nothing more.
  void disconnect(const Lane& lane) noexcept;
  /// Reserves room for one more lane, and the messages that it may hold: connecting it while the
  /// component runs allocates nothing. Before anything runs.
  void provide_for(const Lane::Options& lane, std::size_t keep);

  [[nodiscard]] Envelope* loan(bool is_cleared);
  void return_loan(Envelope* loan) noexcept;
  void publish(Envelope* loan, const PublishOptions& options);
  /// `holder` is the subscription that received it.
  void forward(Envelope* received, Holder holder);
  void publish_external(Envelope* loan, Time taken_at);
  /// Publishes a message of another application: with its publish time, raised if needed to keep
  /// this publisher's times monotonic, its origin, and its trails. Messages lost before it are
  /// `dropped{link}` of each subscription. For an external publisher.
  void publish_arrived(Envelope* loan, const Arrival& arrival);
  /// Publishes a recorded message, with its original sequence, publish time and origin; an origin
  /// without a root is of this publisher. For an external publisher, from a thread that is in no
  /// activation; in simulated time from the driving thread, between rounds.
  void publish_again(Envelope* loan, const MessageInfo& info);

  /// Puts a numbered message into all lanes, and wakes their receivers.
  void deliver(Envelope* envelope) noexcept;

  /// Enables credits with this `window`; the topic's number, or an existing window, overrides it.
  /// Before anything is connected.
  void use_credits(std::size_t window);
  /// Null without a window.
  [[nodiscard]] const std::shared_ptr<Credits>& credits() const noexcept { return credits_; }
  /// How many messages may be published now: the credits at the first call in this activation, less
  /// the messages published since.
  [[nodiscard]] std::size_t ask_credits();
  /// Ends the use of credits in one activation; true if all are used.
  [[nodiscard]] bool end_asking() noexcept;
  /// Waits for credits; see `Credits::await`.
  void await_credits() noexcept { credits_->await(); }
  /// Whether awaited credits were returned; if they are used already, it waits again.
  [[nodiscard]] bool take_returned_credits() noexcept;
  /// For threads of an external publisher: the number of credits, and waiting for one, which
  /// returns false if `stop` ended it.
  [[nodiscard]] std::size_t ask_external_credits();
  [[nodiscard]] bool wait_for_credit(const std::stop_token& stop);

  /// Sets the last sequence: for a replay from the middle, or after a restart of the process.
  void continue_after(std::uint64_t sequence) noexcept {
    handed_over_ = sequence;
    published_.set(sequence);
  }

  /// Sets the filter before the lanes of components; null: none. Before anything is connected; it
  /// outlives all publishes.
  void set_gate(LaneGate* gate) noexcept { gate_ = gate; }
  /// For the gate, which holds its mutex: puts `envelope`, with one reference, into the lane of
  /// `subscription`. False if the lane is gone; then it is released.
  bool put_behind_gate(const Subscription& subscription, Envelope* envelope) noexcept;

  /// Makes this a standby's publisher: its messages are not delivered but given to `comparer`, with
  /// those of the followed publisher, which arrive as for an import. Before anything is published.
  void follow(OutputComparer& comparer);
  /// Takes over from the followed publisher: its messages are delivered from its own sequence on.
  /// Those that the followed one delivered here are not delivered again. Called once nothing
  /// arrives from the followed one any more.
  void stop_following();
  /// After `stop_following`: messages that arrived from the followed one count as published.
  void skip_followed();
  [[nodiscard]] bool is_following() const noexcept { return followed_ != nullptr; }
  /// For a standby's publisher: sets the last sequence; messages published so far do not count.
  void continue_following_after(std::uint64_t sequence);
  /// For a standby's publisher: the followed one's message of this sequence, valid while the caller
  /// holds the mutex; null if it is not here. `is_past`: it cannot arrive any more.
  [[nodiscard]] const Envelope* find_followed(std::uint64_t sequence, bool& is_past) const noexcept;

  /// An external publisher's lock; the others need none.
  [[nodiscard]] base::PriorityMutex& mutex() noexcept { return mutex_; }

  /// Its messages are from another application, where latency chains may begin. Before anything is
  /// connected.
  void bring_trails() noexcept { brings_trails_ = true; }
  [[nodiscard]] bool brings_trails() const noexcept { return brings_trails_; }

  /// Sets where an external publisher's messages wait in simulated time.
  void set_external_stage(Stage* stage) noexcept { external_stage_ = stage; }

  /// Opens or closes an external publisher: messages published while closed are
  /// `dropped{shutdown}`.
  void set_external_open(bool is_open) noexcept { is_open_ = is_open; }
  /// Messages that an external publisher publishes while it is muted are neither delivered nor
  /// counted as dropped.
  void set_external_muted(bool is_muted) noexcept;

  /// It represents a publisher in another process. Constant once anything is connected.
  bool is_imported = false;

  // Constant after construction.
  Topic& topic;
  PublishingComponent& owner;
  const PublisherId id;
  const Options options;
  const std::size_t root_count;  ///< Of latency chains.

  /// Of what is published.
  const google::protobuf::Message& default_instance;

  /// The size of a new message, estimated from its prototype; 0 without one.
  [[nodiscard]] std::uint64_t prototype_bytes() const {
    return prototype_ == nullptr ? 0 : prototype_->SpaceUsedLong();
  }

  /// When it published last; the epoch if it never did. As `publish`; of an external publisher it
  /// takes the mutex.
  [[nodiscard]] Time read_last_publish_time() noexcept;

  /// Subscriptions of components that are connected; taps are not counted. As `publish`.
  [[nodiscard]] std::size_t count_subscribers() const noexcept;

  [[nodiscard]] std::uint64_t published() const noexcept { return published_.get(); }
  /// Messages published while its component was muted.
  [[nodiscard]] std::uint64_t muted() const noexcept { return muted_.get(); }
  /// Of the newest message, if anything was published.
  [[nodiscard]] Time last_publish_time() const noexcept {
    return last_publish_time_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t allocated() const noexcept { return pool_->size(); }
  /// CLOCK_MONOTONIC of the first publish; 0 if there was none.
  [[nodiscard]] std::int64_t first_publish_ns() const noexcept {
    return first_publish_ns_.load(std::memory_order_relaxed);
  }

  /// In a replay: refuses the next loan if it was refused in the recorded run.
  void check_replayed_loan() const;

 private:
  void check_loans() const;
  /// Identifies the next loan within an activation.
  [[nodiscard]] std::string loan_in_words() const;
  [[nodiscard]] Envelope* take_from(Pool& pool, Envelope*& scratch);
  void prepare() const noexcept;
  void number(Envelope& envelope, const Origin& origin, Time now) noexcept;
  void follow(Envelope& envelope, const Trail* cause, const Trail* held) const noexcept;
  /// As `follow`, for a message of another application.
  void follow(Envelope& envelope, const Arrival& arrival, Time now) const noexcept;
  void count_lost(std::uint64_t count) noexcept;
  void send(Envelope* envelope, Stage* stage) noexcept;
  /// As `deliver`, at the end of a simulated round.
  void hand_over(Envelope* envelope) noexcept;
  void put_into_lanes(Envelope* envelope) noexcept;
  void put_through_gate(Envelope* envelope) noexcept;
  void put_followed(Envelope* envelope) noexcept;
  void send_following(Envelope* envelope, const Trail* cause, const Trail* held);
  static void push(const Target& target, Envelope* envelope, const Topic& topic,
                   WakeList& wakes) noexcept;
  void give_loan_back(Envelope* loan) noexcept;
  void share(Envelope& loan) noexcept;
  [[nodiscard]] Envelope* copy_for_export(const Envelope& received);
  void drop_scratch(Envelope* scratch) noexcept;
  void drop_muted(Envelope* loan) noexcept;
  void drop_outside(Envelope* loan) noexcept;
  void keep_latched(Envelope* envelope) noexcept;
  [[nodiscard]] std::size_t count_latched_for(const Lane& lane) const noexcept;
  /// In simulated time: messages that were published, and wait until their round is over.
  [[nodiscard]] std::uint64_t staged() const noexcept {
    return owner.stage == nullptr ? 0 : published_.get() - handed_over_;
  }

  const std::unique_ptr<google::protobuf::Message> prototype_;
  Pool* const pool_;
  Pool* const forwards_;
  PoolShares shares_;
  std::size_t provided_ = 0;  ///< The most that were ever needed, which were allocated.
  std::size_t loans_ = 0;     ///< Lent, and neither published nor returned.

  // Lent when the pool is empty and may not grow; as many as the component ever borrowed at once.
  Envelope* scratch_loans_ = nullptr;
  Envelope* scratch_forwards_ = nullptr;

  std::vector<Target> targets_;
  LaneGate* gate_ = nullptr;  ///< Set only if faults are injected.
  /// While its component is a standby, or takes over. Its own activations reset it to null.
  std::unique_ptr<FollowedOutputs> followed_;
  std::vector<MessageExport*> exports_;  ///< To other processes; most publishers have none.
  std::vector<Envelope*> latched_;
  std::atomic<Time> last_publish_time_{};
  Counter published_;
  Counter muted_;
  std::uint64_t imported_ = 0;     ///< For an import that may repeat: the last sequence.
  std::uint64_t handed_over_ = 0;  ///< In simulated time: those that have left the stage.
  std::shared_ptr<Credits> credits_;
  bool is_asked_ = false;  ///< `ask_credits` was called in this activation.
  /// In simulated time: credits are to be awaited once all published messages have left the stage.
  bool awaits_when_handed_over_ = false;
  std::size_t granted_ = 0;
  std::uint64_t granted_at_ = 0;  ///< Messages published before.
  std::atomic<std::int64_t> first_publish_ns_{0};
  Stage* external_stage_ = nullptr;
  bool is_open_ = false;
  bool is_external_muted_ = false;
  bool brings_trails_ = false;
  base::PriorityMutex mutex_;
};

}  // namespace fastcycle::detail
