#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <utility>

#include "fastcycle/component.h"
#include "fastcycle/message.h"
#include "fastcycle/sample.h"
#include "fastcycle/time.h"

namespace fastcycle {

/// Which messages of several topics belong together.
///
/// The messages of a topic are ordered by arrival; t(m) is the time of message m (see `SyncTime`),
/// and D is `max_difference`. The span of a set is the largest difference between the times of its
/// members.
///
/// `kApproximate`, as a rule: when m arrives, look at all sets of m and one held message of each
/// other topic whose span is at most D.
///  1. If there are any, the one with the smallest span is called at once; among equals, that whose
///     earliest time is earliest, and of messages with one time those that arrived first. Messages
///     that are older than the member of their topic are then discarded.
///  2. If there is none, m is held. If `depth` messages of its topic are held already, the oldest
///     is discarded.
///  3. A message is discarded as soon as no set with it is possible: no span of D that includes its
///     time has, for each other topic, a message that is held, or could still arrive, given that
///     t(m) never decreases within a topic.
///  4. A message that is older than an earlier one of its topic is too late, and is discarded.
///
/// So a set is called when the last of its members arrives, with no period added; each message is
/// in at most one set; for each topic the members of successive sets are in order. With `D` below
/// half the period of the fastest topic a message has only one possible partner in it, and jitter,
/// loss and the order of arrival cannot change which messages are matched.
enum class SyncPolicy : std::uint8_t {
  kExact,        ///< Equal times: as `kApproximate` with D = 0.
  kApproximate,  ///< Times at most `max_difference` apart.
  /// Every message of the first topic, with the newest message of each other topic, whatever its
  /// time; the latter may be used again. Messages of the first topic are discarded until each other
  /// topic had one; so is a message of another topic that is replaced before it was used.
  kLatest,
};

/// The time of a message that a synchronizer compares.
enum class SyncTime : std::uint8_t {
  kTaken,      ///< When its oldest input was measured: `info().origin.taken`.
  kPublished,  ///< `info().publish_time`.
};

/// How a synchronizer finds messages that belong together.
struct SynchronizerOptions {
  /// Which messages belong together.
  SyncPolicy policy = SyncPolicy::kExact;
  Duration max_difference{};  ///< Above zero with `kApproximate`, else zero.
  /// Messages of each topic that are held until their partners arrive; also the depth of each queue
  /// before that, unless `"subscribers"` in the application file overrides it.
  std::size_t depth = 16;
  /// The time that is compared.
  SyncTime time = SyncTime::kTaken;
};

/// A callback for sets: `f(const A&, const B&, …)`, or `f(const Sample<A>&, const Sample<B>&, …)`.
template <typename F, typename... T>
concept SetCallback = std::invocable<F&, const T&...> || std::invocable<F&, const Sample<T>&...>;

namespace detail {

/// A message, and the subscription that received it.
struct SetMember {
  Envelope* envelope;
  Holder holder;
};
/// One member of each topic, in the order in which the topics were declared.
using SetOfEnvelopes = std::span<const SetMember>;
using EnvelopeSetCallback = std::function<void(SetOfEnvelopes)>;

/// A type-erased input of a synchronizer.
struct SynchronizedTopic {
  std::string_view name;
  const google::protobuf::Message* default_instance;
};

void create_synchronizer(ComponentCore& core, std::span<const SynchronizedTopic> topics,
                         const SynchronizerOptions& options, EnvelopeSetCallback callback);

template <typename... T, typename F, std::size_t... I>
EnvelopeSetCallback set_callback(F callback, std::index_sequence<I...>) {
  if constexpr (std::invocable<F&, const Sample<T>&...>) {
    return [callback = std::move(callback)](SetOfEnvelopes set) mutable {
      callback(share<T>(*set[I].envelope, set[I].holder)...);
    };
  } else {
    return [callback = std::move(callback)](SetOfEnvelopes set) mutable {
      callback(static_cast<const T&>(*set[I].envelope->payload)...);
    };
  }
}

}  // namespace detail

template <Message... T, std::size_t N, typename F>
void Context::create_synchronizer(const std::string_view (&topics)[N],
                                  const SynchronizerOptions& options, F callback) {
  static_assert(sizeof...(T) >= 2 && sizeof...(T) <= 4, "a synchronizer has 2 to 4 topics");
  static_assert(N == sizeof...(T), "a synchronizer names one topic for each of its types");
  static_assert(SetCallback<F, T...>,
                "a synchronizer's callback takes one message, or one sample, of each topic");
  FASTCYCLE_REFUSE_COPIED_MESSAGE(F);
  const std::array<const google::protobuf::Message*, N> types{&T::default_instance()...};
  std::array<detail::SynchronizedTopic, N> inputs;
  for (std::size_t i = 0; i < N; ++i) {
    inputs[i] = {topics[i], types[i]};
  }
  detail::create_synchronizer(
      core_, inputs, options,
      detail::set_callback<T...>(std::move(callback), std::make_index_sequence<N>()));
}

}  // namespace fastcycle
