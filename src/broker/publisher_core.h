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

/// What came with a message that another application had published, in the time of this one.
struct Arrival {
  Time published{};
  Origin origin{};
  Time came{};                         ///< To this application.
  std::span<const Trail> trails = {};  ///< One for each root of this application, or none.
  std::uint64_t lost = 0;              ///< Those sent right before it that never came.
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
    std::size_t keep = 0;  ///< Messages that components hold on purpose.
    /// Messages ever made; 0: twice what the subscribers need, plus 64. In simulated time it limits
    /// nothing: what observers and foreign threads hold depends on how fast they are, and what is
    /// lost must not.
    std::size_t pool_max = 0;
    std::size_t latched = 0;                ///< Messages kept for those who connect later.
    std::optional<Duration> lifespan = {};  ///< What is older is not given to them.
  };

  PublisherCore(Topic& topic, PublishingComponent& owner, PublisherId id,
                const google::protobuf::Message& default_instance,
                const google::protobuf::Message* prototype, const Options& options);
  PublisherCore(const PublisherCore&) = delete;
  PublisherCore& operator=(const PublisherCore&) = delete;
  ~PublisherCore();

  /// From now on counts what each of `count` subscriptions of the topic keeps, and a few more that
  /// may come while it runs. Before anything is published.
  void tell_holders_apart(std::size_t count);
  /// How many of its messages the component of a subscription keeps beyond its callbacks. Safe.
  [[nodiscard]] std::size_t kept_by(Holder holder) const noexcept {
    return pool_->kept_by(holder) + forwards_->kept_by(holder);
  }

  /// From now on what is published reaches `lane` too; latched messages go first.
  void connect(const std::shared_ptr<Lane>& lane, Inbox& inbox);
  /// From now on what is published goes to another process too: messages lie where that can read
  /// them. Before anything is published, or as `publish`.
  void add_export(MessageExport& to);
  /// Gives `to`, one of these, the last latched messages, at most `count`; as `publish`.
  void give_latched(MessageExport& to, std::size_t count) noexcept;
  /// Of an import: puts a message of the publisher that this stands for, with all that is known of
  /// it, into the lanes. What is missing between its sequence and that of the message before is
  /// counted as lost on the way. `may_repeat`: what came before is left out, since who took the
  /// place of another one publishes again what may be missing. Under the mutex.
  void publish_imported(Envelope* envelope, bool may_repeat) noexcept;
  /// `lane` is closed and gets nothing more.
  void disconnect(const Lane& lane) noexcept;
  /// From now on there is room for one more lane, and messages for all that it may hold: when it is
  /// connected while the component runs, nothing is allocated. Before anything runs.
  void provide_for(const Lane::Options& lane, std::size_t keep);

  [[nodiscard]] Envelope* loan(bool is_cleared);
  void return_loan(Envelope* loan) noexcept;
  void publish(Envelope* loan, const PublishOptions& options);
  /// `holder` is the subscription that received it.
  void forward(Envelope* received, Holder holder);
  void publish_external(Envelope* loan, Time taken_at);
  /// Publishes what another application had published: with its publish time, which is raised where
  /// this publisher's messages would go back in time, with its origin, and with the ways that it
  /// came. What was lost before it is `dropped{link}` of each subscription. For an external
  /// publisher.
  void publish_arrived(Envelope* loan, const Arrival& arrival);
  /// Publishes what was published once before, with sequence, publish time and origin of then; an
  /// origin without a root is of this publisher. For an external publisher, from a thread that is
  /// in no activation; in simulated time from the one that runs it, between rounds.
  void publish_again(Envelope* loan, const MessageInfo& info);

  /// Puts a message, numbered already, into all lanes, and wakes who must be woken.
  void deliver(Envelope* envelope) noexcept;

  /// From now on asks for credits, `window` of them; the topic's own number stands above that, and
  /// a window that there is already. Before anything is connected.
  void use_credits(std::size_t window);
  /// Null without a window.
  [[nodiscard]] const std::shared_ptr<Credits>& credits() const noexcept { return credits_; }
  /// How many messages may be published now: what was there when it was asked first in this
  /// activation, less what was published since.
  [[nodiscard]] std::size_t ask_credits();
  /// Ends the asking of one activation; true if all that there was is used.
  [[nodiscard]] bool end_asking() noexcept;
  /// Waits for credits; see `Credits::await`.
  void await_credits() noexcept { credits_->await(); }
  /// Whether credits came that were awaited; those that are gone already are awaited again.
  [[nodiscard]] bool take_returned_credits() noexcept;
  /// For threads of an external publisher: how many there are, and waiting for the first. False if
  /// `stop` ended that.
  [[nodiscard]] std::size_t ask_external_credits();
  [[nodiscard]] bool wait_for_credit(const std::stop_token& stop);

  /// The next message follows the one of this number: where a recorded run is executed again from
  /// the middle, or its process was restarted.
  void continue_after(std::uint64_t sequence) noexcept {
    handed_over_ = sequence;
    published_.set(sequence);
  }

  /// From now on `gate` decides what reaches the lanes of components; null: all that is published
  /// does. Before anything is connected; it has to live as long as something is published.
  void set_gate(LaneGate* gate) noexcept { gate_ = gate; }
  /// Of the gate, which holds its mutex: puts `envelope`, of which one reference is given away,
  /// into the lane of `subscription`. False if there is none any more; then it is released.
  bool put_behind_gate(const Subscription& subscription, Envelope* envelope) noexcept;

  /// Its component follows another one from now on: what it publishes goes nowhere and is given to
  /// `comparer`, with what that one's publisher does, which comes as to an import. Before anything
  /// is published.
  void follow(OutputComparer& comparer);
  /// It takes the other one's place: from now on what it publishes goes on from what it published
  /// itself. What of that came here from the other one reaches nobody here again. Once nothing of
  /// the other one comes any more.
  void stop_following();
  /// After `stop_following`: what came here from the other one was published, and is not done
  /// again.
  void skip_followed();
  [[nodiscard]] bool is_following() const noexcept { return followed_ != nullptr; }
  /// Of one that follows: the next message has the number after this; what it published so far does
  /// not count.
  void continue_following_after(std::uint64_t sequence);
  /// Of one that follows: the other one's message of this sequence, which is held as long as the
  /// caller holds the mutex; null if it is not here. `is_past`: it does not come any more.
  [[nodiscard]] const Envelope* find_followed(std::uint64_t sequence, bool& is_past) const noexcept;

  /// An external publisher's lock; the others need none.
  [[nodiscard]] base::PriorityMutex& mutex() noexcept { return mutex_; }

  /// What it publishes comes from another application, where latency chains may begin. Before
  /// anything is connected.
  void bring_trails() noexcept { brings_trails_ = true; }
  [[nodiscard]] bool brings_trails() const noexcept { return brings_trails_; }

  /// Where an external publisher's messages go in simulated time.
  void set_external_stage(Stage* stage) noexcept { external_stage_ = stage; }

  /// Opens or closes an external publisher: what it publishes while closed is `dropped{shutdown}`.
  void set_external_open(bool is_open) noexcept { is_open_ = is_open; }
  /// What an external publisher publishes while it is muted reaches nobody, and counts for nobody.
  void set_external_muted(bool is_muted) noexcept;

  /// It stands for a publisher in another process. Constant once anything is connected.
  bool is_imported = false;

  // Constant after construction.
  Topic& topic;
  PublishingComponent& owner;
  const PublisherId id;
  const Options options;
  const std::size_t root_count;  ///< Of latency chains.

  /// Of what is published.
  const google::protobuf::Message& default_instance;

  /// What the memory of a new message takes, as far as its prototype tells; 0 without one.
  [[nodiscard]] std::uint64_t prototype_bytes() const {
    return prototype_ == nullptr ? 0 : prototype_->SpaceUsedLong();
  }

  /// When it published last; the epoch if it never did. As `publish`; of an external publisher it
  /// takes the mutex.
  [[nodiscard]] Time read_last_publish_time() noexcept;

  /// Subscriptions of components that are connected; taps are not counted. As `publish`.
  [[nodiscard]] std::size_t count_subscribers() const noexcept;

  [[nodiscard]] std::uint64_t published() const noexcept { return published_.get(); }
  /// What was given to it while its component was muted.
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

  /// Refuses the next loan if it was refused when this activation was recorded.
  void check_told_loan() const;

 private:
  void check_loans() const;
  /// Tells the next loan from the others of an activation.
  [[nodiscard]] std::string loan_in_words() const;
  [[nodiscard]] Envelope* take_from(Pool& pool, Envelope*& scratch);
  void prepare() const noexcept;
  void number(Envelope& envelope, const Origin& origin, Time now) noexcept;
  void follow(Envelope& envelope, const Trail* cause, const Trail* held) const noexcept;
  /// As `follow`, for what another application had published.
  void follow(Envelope& envelope, const Arrival& arrival, Time now) const noexcept;
  void count_lost(std::uint64_t count) noexcept;
  void send(Envelope* envelope, Stage* stage) noexcept;
  /// As `deliver`, when a simulated round is over.
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
  std::size_t provided_ = 0;  ///< The most that were ever needed: so many were made.
  std::size_t loans_ = 0;     ///< Lent, and neither published nor returned.

  // Lent when the pool is dry and may not grow; as many as the component ever borrowed at once.
  Envelope* scratch_loans_ = nullptr;
  Envelope* scratch_forwards_ = nullptr;

  std::vector<Target> targets_;
  LaneGate* gate_ = nullptr;  ///< Only where faults are injected.
  /// While its component follows another one, or takes its place. Its own activations make it null.
  std::unique_ptr<FollowedOutputs> followed_;
  std::vector<MessageExport*> exports_;  ///< To other processes; most publishers have none.
  std::vector<Envelope*> latched_;
  std::atomic<Time> last_publish_time_{};
  Counter published_;
  Counter muted_;
  std::uint64_t imported_ = 0;     ///< Of an import that may repeat: the last sequence.
  std::uint64_t handed_over_ = 0;  ///< In simulated time: of those, who left the stage.
  std::shared_ptr<Credits> credits_;
  bool is_asked_ = false;  ///< For credits, in this activation.
  /// In simulated time: credits are to be awaited once all that was published has left the stage.
  bool awaits_when_handed_over_ = false;
  std::size_t granted_ = 0;
  std::uint64_t granted_at_ = 0;  ///< What was published before.
  std::atomic<std::int64_t> first_publish_ns_{0};
  Stage* external_stage_ = nullptr;
  bool is_open_ = false;
  bool is_external_muted_ = false;
  bool brings_trails_ = false;
  base::PriorityMutex mutex_;
};

}  // namespace fastcycle::detail
