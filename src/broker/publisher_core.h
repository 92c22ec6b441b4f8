#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <pthread.h>

#include "base/clock.h"
#include "broker/credits.h"
#include "broker/inbox.h"
#include "broker/pool.h"
#include "broker/subscription.h"
#include "fastcycle/publisher.h"

namespace fastcycle::detail {

class Topic;

/// Where published messages wait until a round of simulated time is over.
class Stage {
 public:
  Stage() = default;
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;
  virtual ~Stage() = default;

  virtual void put(PublisherCore& publisher, Envelope* envelope) = 0;
};

/// What a publisher must know of the component that owns it.
///
/// @threads  Confined to the component's activations, and to the control thread before the start.
struct PublishingComponent {
  std::string name;
  const base::Clock* clock = nullptr;
  Stage* stage = nullptr;         ///< In simulated time; null when live.
  bool has_subscribers = false;   ///< Then its messages inherit their origin.
  bool is_in_activation = false;  ///< Only then it may publish,
  bool is_muted = false;          ///< unless it is muted: then nobody hears it.
  Time now{};                     ///< The activation's time.
  Duration simulated_cost{0};     ///< In simulated time: how much later it publishes.
  /// The activation's origin; root 0 if nothing led to it. That of a message is read only if
  /// something is published.
  const Origin* origin = &kNoOrigin;
  static constexpr Origin kNoOrigin{};
  /// What led to the activation, for each root of latency chains; null if nothing did.
  const Trail* trails = nullptr;
  /// The newest that was delivered for each root, for those that the cause knows nothing of; null
  /// where there are no chains.
  const Trail* held_trails = nullptr;
  std::uint32_t publish_count = 0;  ///< In this activation.
  Time published{};                 ///< The last publish time of its own publishers.
  /// Something is to be done when the activation is over: publishers were asked for credits, or a
  /// subscription has ended.
  bool has_leftovers = false;
  std::vector<PublisherCore*> asked = {};  ///< For credits.
};

/// A mutex whose holder inherits the priority of who waits for it.
class PriorityMutex {
 public:
  PriorityMutex();
  PriorityMutex(const PriorityMutex&) = delete;
  PriorityMutex& operator=(const PriorityMutex&) = delete;
  ~PriorityMutex();
  void lock() noexcept;
  void unlock() noexcept;

 private:
  pthread_mutex_t mutex_;
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
    std::size_t keep = 0;      ///< Messages that components hold on purpose.
    std::size_t pool_max = 0;  ///< Messages ever made; 0: twice what the subscribers need, plus 64.
    std::size_t latched = 0;   ///< Messages kept for those who connect later.
    std::optional<Duration> lifespan = {};  ///< What is older is not given to them.
  };

  PublisherCore(Topic& topic, PublishingComponent& owner, PublisherId id,
                const google::protobuf::Message& default_instance,
                const google::protobuf::Message* prototype, const Options& options);
  PublisherCore(const PublisherCore&) = delete;
  PublisherCore& operator=(const PublisherCore&) = delete;
  ~PublisherCore();

  /// From now on what is published reaches `lane` too; latched messages go first.
  void connect(const std::shared_ptr<Lane>& lane, Inbox& inbox);
  /// `lane` is closed and gets nothing more.
  void disconnect(const Lane& lane) noexcept;
  /// From now on there is room for one more lane, and messages for all that it may hold: when it is
  /// connected while the component runs, nothing is allocated. Before anything runs.
  void provide_for(const Lane::Options& lane, std::size_t keep);

  [[nodiscard]] Envelope* loan(bool is_cleared);
  void return_loan(Envelope* loan) noexcept;
  void publish(Envelope* loan, const PublishOptions& options);
  void forward(Envelope* received);
  void publish_external(Envelope* loan, Time taken_at);
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

  /// An external publisher's lock; the others need none.
  [[nodiscard]] PriorityMutex& mutex() noexcept { return mutex_; }

  /// Where an external publisher's messages go in simulated time.
  void set_external_stage(Stage* stage) noexcept { external_stage_ = stage; }

  /// Opens or closes an external publisher: what it publishes while closed is `dropped{shutdown}`.
  void set_external_open(bool is_open) noexcept { is_open_ = is_open; }
  /// What an external publisher publishes while it is muted reaches nobody, and counts for nobody.
  void set_external_muted(bool is_muted) noexcept;

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

 private:
  struct Target {
    std::shared_ptr<Lane> lane;
    Inbox* inbox;
    std::uint64_t bit;
  };

  [[nodiscard]] std::size_t pool_limit() const noexcept;
  [[nodiscard]] Envelope* take_from(Pool& pool, Envelope*& scratch);
  void prepare() const noexcept;
  void number(Envelope& envelope, const Origin& origin, Time now) noexcept;
  void follow(Envelope& envelope, const Trail* cause, const Trail* held) const noexcept;
  void send(Envelope* envelope, Stage* stage) noexcept;
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
  std::size_t needed_ = 0;    ///< By the subscriptions that there are now, and by the owner.
  std::size_t provided_ = 0;  ///< The most that were ever needed: so many were made.

  // Lent when the pool is dry and may not grow; as many as the component ever borrowed at once.
  Envelope* scratch_loans_ = nullptr;
  Envelope* scratch_forwards_ = nullptr;

  std::vector<Target> targets_;
  std::vector<Envelope*> latched_;
  std::atomic<Time> last_publish_time_{};
  Counter published_;
  Counter muted_;
  std::uint64_t handed_over_ = 0;  ///< In simulated time: of those, who left the stage.
  std::shared_ptr<Credits> credits_;
  bool is_asked_ = false;  ///< For credits, in this activation.
  std::size_t granted_ = 0;
  std::uint64_t granted_at_ = 0;  ///< What was published before.
  std::atomic<std::int64_t> first_publish_ns_{0};
  Stage* external_stage_ = nullptr;
  bool is_open_ = false;
  bool is_external_muted_ = false;
  PriorityMutex mutex_;
};

}  // namespace fastcycle::detail
