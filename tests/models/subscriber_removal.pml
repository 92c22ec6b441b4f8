/*
 * A subscription that ends, is made again, or fails, while its publisher goes on publishing.
 *
 * Mirrors  Subscription::close, add_lane, add_to (src/broker/subscription.cc); Lane::push, peek,
 *          read, pop, drain (src/broker/lane.h); PublisherCore::deliver, connect, disconnect
 *          (src/broker/publisher_core.cc); Actor::take (src/executor/actor.cc);
 *          Wiring::connect_late, end_subscription (src/component/wiring.cc).
 * Leaves out  waking: the receiver looks until nothing comes any more, whether what it finds was
 *          marked or not, as a worker does that waits by looking. The registry's mutex, under
 *          which connects and disconnects are posted one after the other. Slots' times. A lane is
 *          freed by the last of its two shared pointers. Counters, which have one writer each: the
 *          receiver those of delivered and drained, the publisher all others.
 * Checks   published = delivered + dropped when all is still, and every message is delivered or
 *          dropped exactly once; nothing stays in a lane that was closed; nothing is delivered
 *          after the end; the publisher keeps no lane that its receiver left; nothing is counted
 *          in a lane after it was retired.
 *
 * The store of `tail` may be seen late, after the publisher has looked whether the lane was closed.
 *
 * The receiver subscribes, ends the subscription at any time, and subscribes again, SUBSCRIBED
 * times in all. The publisher's component publishes PUBLISHED messages, and applies connects and
 * disconnects as control causes between them. LATCHED: the last message is kept for who comes
 * later. FAULT: in the end the receiver closes and stays connected.
 *
 * run short: one subscription                        -DPUBLISHED=3
 * run short: depth 2                                 -DPUBLISHED=3 -DDEPTH=2
 * run short: subscribed twice                        -DSUBSCRIBED=2 -DPUBLISHED=2
 * run short: a latched message                       -DSUBSCRIBED=2 -DPUBLISHED=2 -DLATCHED
 * run short: a receiver that fails                   -DPUBLISHED=3 -DFAULT
 * run long: one subscription, five messages          -DPUBLISHED=5 -DDEPTH=2
 * run long: subscribed three times                   -DSUBSCRIBED=3 -DPUBLISHED=3
 * run long: latched, subscribed three times          -DSUBSCRIBED=3 -DPUBLISHED=3 -DLATCHED
 * run long: a receiver that fails, five messages     -DPUBLISHED=5 -DDEPTH=2 -DFAULT
 * bug BUG_CLOSED_NOT_CHECKED: the publisher does not look whether the lane was closed  -DPUBLISHED=2
 * bug BUG_CLOSED_CHECKED_FIRST: it looks before it pushes                    -DPUBLISHED=2
 * bug BUG_DRAINED_FIRST: the receiver drains, then marks the lane as closed  -DPUBLISHED=2
 * bug BUG_BLIND_DRAIN: what is drained is taken without comparing `head`     -DPUBLISHED=2
 * bug BUG_DRAINED_TO_TAIL: a lane is drained up to `tail`, which may come late  -DPUBLISHED=1
 * bug BUG_DRAIN_IGNORES_LAP: what is drained may be from the round before    -DPUBLISHED=1
 * bug BUG_CONNECT_NOT_CHECKED: a connect does not look whether the lane was closed     -DSUBSCRIBED=1 -DPUBLISHED=1 -DLATCHED
 * bug BUG_DELIVERED_CLOSED: what was taken from a closed lane is delivered   -DPUBLISHED=2 -DFAULT
 * bug BUG_RETIRED_EARLY: a lane is retired when its receiver left            -DSUBSCRIBED=2 -DPUBLISHED=2
 */
#ifndef SUBSCRIBED
#define SUBSCRIBED 1
#endif
#ifndef DEPTH
#define DEPTH 1
#endif

#define FLAG(i) (1 << (i))
#define SLOT(lane, position) ((lane) * DEPTH + (position) % DEPTH)
#define LAP(position) (((position) & DEPTH) == 0)
#define WORD(message, position) ((message) * 2 + LAP(position)) /* Slot::envelope */
#define MESSAGE_OF(word) ((word) / 2)
#define HOLDS(lane) ((slot[SLOT(lane, head[lane])] & 1) == LAP(head[lane]))
#define COPY(lane, message) ((lane) * PUBLISHED + (message))
#define NIL 255

/* The lanes, one each time that the receiver subscribes. */
byte head[SUBSCRIBED], tail[SUBSCRIBED], slot[SUBSCRIBED * DEPTH];
byte known_head[SUBSCRIBED]; /* the publisher's */
byte place[SUBSCRIBED];      /* `tail`, as the publisher, its only writer, knows it */
bool is_closed[SUBSCRIBED];
bool is_left_by_publisher[SUBSCRIBED], is_left_by_receiver[SUBSCRIBED];
byte published[SUBSCRIBED], overflowed[SUBSCRIBED], after_close[SUBSCRIBED]; /* the publisher's */
byte delivered[SUBSCRIBED], drained[SUBSCRIBED];                             /* the receiver's */

/* The subscription's list of lanes, and the sums of those that are done. */
bool is_listed[SUBSCRIBED];
byte retired_in, retired_out;

/* Control causes for the publisher's component: 2 * lane to connect it, and one more to disconnect. */
chan controls = [2 * SUBSCRIBED * SUBSCRIBED] of {byte};

/* What is observed. */
byte targets; /* bit: the publisher knows the lane */
byte gone[SUBSCRIBED * PUBLISHED];
byte pushed = 0;
bool receiver_ended = false, publisher_ended = false;

/* Lane::drain, by either end; `count` is how many. */
inline drain(lane) {
  count = 0;
  do
  :: at = head[lane];
#ifdef BUG_DRAINED_TO_TAIL
     if
     :: tail[lane] == at -> break
     :: else
     fi;
#endif
     word = slot[SLOT(lane, at)];
     if
#ifdef BUG_DRAIN_IGNORES_LAP
     :: false
#else
     :: (word & 1) != LAP(at) ->
        if
        :: head[lane] == at -> break
        :: else
        fi
#endif
     :: else ->
        if
        :: head[lane] == at ->
           atomic {
             if
#ifdef BUG_BLIND_DRAIN
             :: true ->
                assert(HOLDS(lane));
                head[lane] = head[lane] + 1; gone[COPY(lane, MESSAGE_OF(word))]++; count++
#else
             :: head[lane] == at ->
                assert(HOLDS(lane));
                head[lane] = head[lane] + 1; gone[COPY(lane, MESSAGE_OF(word))]++; count++
             :: else
#endif
             fi
           }
        :: else
        fi
     fi
  od;
  atomic { at = 0; word = 0 }
}

inline push(lane, message) {
  d_step { assert(!is_left_by_publisher[lane]); published[lane]++; pushed++ }
  if
  :: place[lane] - known_head[lane] >= DEPTH -> known_head[lane] = head[lane]
  :: else
  fi;
  if
  :: place[lane] - known_head[lane] >= DEPTH ->
     word = slot[SLOT(lane, known_head[lane])];
     atomic {
       if
       :: head[lane] == known_head[lane] ->
          head[lane] = head[lane] + 1; known_head[lane] = head[lane];
          gone[COPY(lane, MESSAGE_OF(word))]++; overflowed[lane]++
       :: else -> known_head[lane] = head[lane]
       fi
     }
  :: else
  fi;
  slot[SLOT(lane, place[lane])] = WORD(message, place[lane]);
  place[lane]++;
  if
  :: tail[lane] = place[lane]
  :: true /* seen later */
  fi;
  word = 0
}

/* What of `tail` was not seen yet is seen now. */
inline settle(lane) {
  if
  :: tail[lane] != place[lane] -> tail[lane] = place[lane]
  :: else
  fi
}

inline take_back(lane) {
  if
  :: is_closed[lane] ->
     drain(lane);
     after_close[lane] = after_close[lane] + count;
     count = 0
  :: else
  fi
}

inline connect(lane) {
#ifdef LATCHED
  if
  :: latched != NIL -> push(lane, latched)
  :: else
  fi;
#endif
  targets = targets | FLAG(lane);
#ifndef BUG_CONNECT_NOT_CHECKED
  take_back(lane);
#endif
  settle(lane)
}

inline disconnect(lane) {
  if
  :: (targets & FLAG(lane)) ->
     targets = targets & ~FLAG(lane);
     is_left_by_publisher[lane] = true
  :: else
  fi
}

inline deliver(message) {
  latched = message;
  lane = 0;
  do
  :: lane < SUBSCRIBED && (targets & FLAG(lane)) ->
#ifdef BUG_CLOSED_CHECKED_FIRST
     take_back(lane);
     push(lane, message);
#else
     push(lane, message);
#ifndef BUG_CLOSED_NOT_CHECKED
     take_back(lane);
#endif
#endif
     settle(lane);
     lane++
  :: lane < SUBSCRIBED && !(targets & FLAG(lane)) -> lane++
  :: else -> break
  od;
  lane = 0
}

proctype Publisher() {
  byte lane, at, word, count, next, latched = NIL, cause;
  do
  :: controls?cause ->
     lane = cause / 2;
     if
     :: cause % 2 == 0 -> connect(lane)
     :: else -> disconnect(lane)
     fi;
     atomic { lane = 0; cause = 0 }
  :: next < PUBLISHED -> deliver(next); next++
  :: next == PUBLISHED && empty(controls) && receiver_ended -> break
  od;
  publisher_ended = true
}

/* Subscription::add_lane, under its mutex, then Application::connect_late. */
inline subscribe(lane) {
  atomic {
    other = 0;
    do
    :: other < lane ->
       if
#ifdef BUG_RETIRED_EARLY
       :: is_listed[other] && is_left_by_receiver[other] ->
#else
       :: is_listed[other] && is_left_by_receiver[other] && is_left_by_publisher[other] ->
#endif
          is_listed[other] = false;
          retired_in = retired_in + published[other];
          retired_out = retired_out + overflowed[other] + after_close[other] + delivered[other] +
                        drained[other]
       :: else
       fi;
       other++
    :: else -> break
    od;
    other = 0;
    is_listed[lane] = true
  }
  controls!(2 * lane)
}

/* Subscription::close: of all its lanes only the last can still be open. */
inline close(lane) {
#ifdef BUG_DRAINED_FIRST
  drain(lane);
  is_closed[lane] = true;
#else
  is_closed[lane] = true;
  drain(lane);
#endif
  drained[lane] = drained[lane] + count;
  count = 0
}

/* Application::end_subscription: all lanes that are still listed are left, again if need be. */
inline unsubscribe(lane) {
  close(lane);
  is_left_by_receiver[lane] = true;
  other = 0;
  do
  :: other <= lane ->
     if
     :: is_listed[other] -> controls!(2 * other + 1)
     :: else
     fi;
     other++
  :: else -> break
  od;
  other = 0
}

/* Lane::peek, with one look, then Actor::take. */
inline receive(lane) {
  at = head[lane];
  word = slot[SLOT(lane, at)];
  if
  :: (word & 1) != LAP(at)
  :: else ->
     if
     :: head[lane] == at ->
        atomic {
          is_mine = head[lane] == at;
          if
          :: is_mine ->
             assert(at <= tail[lane]);
             head[lane] = head[lane] + 1; gone[COPY(lane, MESSAGE_OF(word))]++
          :: else
          fi
        }
        if
        :: is_mine ->
           is_mine = false;
#ifndef BUG_DELIVERED_CLOSED
           if
           :: is_closed[lane] -> drained[lane]++
           :: else -> assert(!has_failed); delivered[lane]++
           fi
#else
           assert(!has_failed);
           delivered[lane]++
#endif
        :: else
        fi
     :: else
     fi
  fi;
  atomic { at = 0; word = 0 }
}

proctype Receiver() {
  byte lane, other, at, word, count;
  bool is_mine, has_failed;
  do
  :: lane < SUBSCRIBED ->
     subscribe(lane);
     do
     :: HOLDS(lane) -> receive(lane)
     :: true -> break
     od;
#ifdef FAULT
     if
     :: lane == SUBSCRIBED - 1 -> has_failed = true; close(lane); break
     :: else
     fi;
#endif
     unsubscribe(lane);
     lane++
  :: else -> break
  od;
  receiver_ended = true;
#ifdef FAULT
end_failed:
  do
  :: HOLDS(lane) -> receive(lane)
  od
#endif
}

init {
  byte lane, m;
  atomic { run Receiver(); run Publisher() }
  timeout -> d_step {
    assert(publisher_ended);
    do
    :: lane < SUBSCRIBED ->
       assert(head[lane] == tail[lane]);
       if
       :: is_listed[lane] ->
          retired_in = retired_in + published[lane];
          retired_out = retired_out + overflowed[lane] + after_close[lane] + delivered[lane] +
                        drained[lane]
       :: else
       fi;
       lane++
    :: else -> break
    od;
    assert(retired_in == retired_out && retired_in == pushed);
#ifdef FAULT
    assert(targets == FLAG(SUBSCRIBED - 1));
#else
    assert(targets == 0);
#endif
    lane = 0; m = 0;
    do
    :: m < SUBSCRIBED * PUBLISHED -> lane = lane + gone[m]; assert(gone[m] <= 1); m++
    :: else -> break
    od;
    assert(lane == pushed)
  }
}
