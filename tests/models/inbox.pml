/*
 * Lanes and the inbox: what publishers push, one worker takes.
 *
 * Mirrors  Lane::push, peek, read, pop (src/broker/lane.h); Inbox::mark, begin, peek, peek_bit,
 *          peek_early, try_end_idle (src/broker/inbox.{h,cc}); SharedBit::mark, peek
 *          (src/broker/shared_bit.{h,cc}); the loop of PublisherCore::deliver;
 *          Actor::run_early, as far as lanes go (src/executor/actor.cc).
 * Leaves out  what an envelope is: a message is its number, given where the publish time is
 *          taken, so that a smaller number is an earlier time. Inbox::peek's short way for one
 *          ready lane, which is the same look. Counts are not 64 bits wide, but
 *          no run comes near their end. Several workers, control causes and timers:
 *          actor_state.pml. Closing: subscriber_removal.pml.
 * Checks   every message is delivered or dropped exactly once; published = delivered + dropped;
 *          nothing is left behind when all is still (no lost wake-up); if push A returned before
 *          push B began, A is not served after B, also where lanes share a bit, and where B is
 *          served before it was marked; a slot is never read half old, half new; a lane that is
 *          never empty is not found empty; `head` is at most one ahead of `tail`.
 *
 * Nobody waits for `tail`: its store may be seen late, after the publisher has read the state word.
 * EARLY: the worker also takes messages from the lanes while it waits for the component to be
 * queued. It does not once all publishers are done: what is left then, their marks must bring.
 * SHARED: the last two lanes share the last bit; behind it each has one of its own. Which of them
 * stand in the heap is `held`, and by what time is `known_time`.
 *
 * run short: two publishers, depth 1     -DN0=2 -DN1=1
 * run short: the other sends twice       -DN0=1 -DN1=2
 * run short: depth 2                     -DN0=3 -DN1=1 -DDEPTH=2
 * run short: lanes share a bit           -DSHARED -DN0=1 -DN1=2
 * run short: drop_newest                 -DN0=2 -DN1=1 -DDROP_NEWEST
 * run short: early, depth 1              -DEARLY -DN0=2 -DN1=1
 * run short: a slot to spare             -DSLOTS=2 -DN0=2 -DN1=1
 * run long: three rounds of one slot     -DN0=4 -DN1=1
 * run long: early, two each              -DEARLY -DN0=2 -DN1=2
 * run long: early, depth 2               -DEARLY -DN0=3 -DN1=1 -DDEPTH=2
 * run long: early, lanes share a bit     -DEARLY -DSHARED -DN0=2 -DN1=1
 * run long: early, drop_newest           -DEARLY -DN0=3 -DN1=1 -DDROP_NEWEST
 * run long: early, a slot to spare       -DEARLY -DSLOTS=2 -DN0=1 -DN1=2
 * run long: a slot to spare              -DSLOTS=2 -DN0=3 -DN1=2
 * run long: two publishers, two each     -DN0=2 -DN1=2
 * run long: two publishers, depth 1      -DN0=3 -DN1=2
 * run long: depth 2                      -DN0=3 -DN1=3 -DDEPTH=2
 * run short: one of three lanes shares    -DSHARED -DLANES=3 -DN0=1 -DN1=1
 * run long: lanes share a bit            -DSHARED -DN0=2 -DN1=2
 * run long: lanes share a bit, depth 2   -DSHARED -DN0=3 -DN1=1 -DDEPTH=2
 * run long: lanes share, drop_newest     -DSHARED -DN0=3 -DN1=1 -DDROP_NEWEST
 * run long: three lanes, two on one bit  -DSHARED -DLANES=3 -DN0=1 -DN1=1 -DN2=1
 * run long: three lanes                  -DLANES=3 -DN0=1 -DN1=1 -DN2=1
 * run long: drop_newest                  -DN0=3 -DN1=2 -DDROP_NEWEST
 * bug BUG_NO_SECOND_LOOK: the worker clears a bit and does not look again     -DN0=2 -DN1=1
 * bug BUG_WORD_READ_ONCE: the state word is not read again after the look     -DN0=1 -DN1=2
 * bug BUG_SHARED_ONE_LOOK: newly marked lanes are not looked for after the oldest was found  -DSHARED -DN0=1 -DN1=2
 * bug BUG_SHARED_MARKED_FIRST: the shared bit is set before the lane's own  -DSHARED -DN0=1 -DN1=1
 * bug BUG_SHARED_NO_SECOND_LOOK: a lane's own bit is cleared, and the lane not looked into again  -DSHARED -DN0=2 -DN1=1
 * bug BUG_SHARED_CLEARED_LAST: the shared bit is cleared, and marked lanes are not looked for again  -DSHARED -DN0=2 -DN1=1
 * bug BUG_SHARED_TIME_KEPT: the heap's first is taken for the oldest by a time that it had  -DSHARED -DN0=2 -DN1=1
 * bug BUG_BLIND_POP: `head` is advanced without comparing its position        -DN0=2 -DN1=1
 * bug BUG_BLIND_DROP: the publisher drops what may be gone already            -DN0=2 -DN1=1
 * bug BUG_MARK_SKIPPED_EARLY: whether the bit is set is read before the message is there  -DN0=2 -DN1=1
 * bug BUG_MARK_FIRST: the bit is set before the message is there              -DN0=1 -DN1=1
 * bug BUG_LATE_READ: the slot is read after `head` was advanced               -DN0=2 -DN1=1
 * bug BUG_BLIND_END: a turn ends without comparing the state word             -DN0=1 -DN1=1
 * bug BUG_LAP_NOT_COMPARED: what stands in a slot is taken, whichever round it is from  -DN0=1 -DN1=1
 * bug BUG_LAP_FIRST: a slot's lap is written before the rest of it            -DN0=2 -DN1=0
 * bug BUG_LAP_ONLY: a slot whose lap is right is taken without a second look at `head`  -DN0=3 -DN1=0
 * bug BUG_EMPTY_BY_LAP: a lane is empty where a lap is wrong, wherever `head` is now  -DDEPTH=2 -DN0=4 -DN1=0
 * bug BUG_EMPTY_BY_TAIL: the receiver believes `tail`, which may come late    -DN0=1 -DN1=1
 * bug BUG_EARLY_ONE_LOOK: the oldest of two lanes is looked for once          -DEARLY -DN0=1 -DN1=1
 * bug BUG_EARLY_CLEARS: who takes a message early clears the lane's bit       -DEARLY -DN0=2 -DN1=0
 */
#ifndef LANES
#define LANES 2
#endif
#ifndef DEPTH
#define DEPTH 1
#endif
#ifndef N2
#define N2 0
#endif
#ifndef SLOTS
#define SLOTS DEPTH /* a power of two, at least DEPTH */
#endif
#define MESSAGES (N0 + N1 + N2)
#define NONE 255

#ifdef SHARED
#define SHARED_BIT (LANES - 2)
#define BIT_OF(lane) ((lane) - ((lane) == LANES - 1))
#else
#define BIT_OF(lane) (lane)
#endif
#ifdef SHARED
#define BITS (LANES - 1)
#else
#define BITS LANES
#endif
#define FLAG(nr) (1 << (nr))
#define LANE_MASK ((1 << BITS) - 1)
#define RUNNING 128
#define SLOT(lane, position) ((lane) * SLOTS + (position) % SLOTS)
#define LAP(position) (((position) & SLOTS) == 0)
#define WORD(message, position) ((message) * 2 + LAP(position)) /* Slot::envelope */
#define MESSAGE_OF(word) ((word) / 2)

byte state = 0;       /* Inbox::state_ */
bool queued = false;  /* the component's bit in the executor's mask */
#ifdef SHARED
byte marked = 0;      /* SharedBit::marked_, by lane */
#endif
byte head[LANES], tail[LANES];
byte known_head[LANES]; /* the publisher's */
byte slot_time[LANES * SLOTS], slot_word[LANES * SLOTS];

/* What is observed. */
byte next_message = 0;
byte returned = 0;          /* bit m: the push of message m returned */
byte before[MESSAGES];      /* what had returned when message m began */
byte gone[MESSAGES];        /* how often message m was delivered or dropped */
byte published = 0, delivered = 0, dropped = 0;
byte publishers_done = 0;

inline mark(nr) {
  if
#ifdef BUG_MARK_SKIPPED_EARLY
  :: was_set
#else
  :: (state & FLAG(nr)) /* set already: nothing to write */
#endif
  :: else ->
     atomic { old_state = state; state = state | FLAG(nr) }
     if
     :: old_state == 0 -> queued = true
     :: else
     fi;
     old_state = 0
  fi
}

inline mark_lane(lane) {
#ifdef SHARED
#ifdef BUG_SHARED_MARKED_FIRST
  mark(BIT_OF(lane));
#endif
  if
  :: BIT_OF(lane) == SHARED_BIT ->
     if
     :: marked & FLAG(lane)
     :: else -> marked = marked | FLAG(lane)
     fi
  :: else
  fi;
#endif
#ifndef BUG_SHARED_MARKED_FIRST
  mark(BIT_OF(lane))
#endif
}

inline push(lane) {
  d_step { m = next_message; next_message++; before[m] = returned; published++ }
#ifdef BUG_MARK_SKIPPED_EARLY
  was_set = (state & FLAG(BIT_OF(lane))) != 0;
#endif
#ifdef BUG_MARK_FIRST
  mark_lane(lane);
#endif
  if
  :: place - known_head[lane] >= DEPTH -> known_head[lane] = head[lane]
  :: else
  fi;
  if
  :: place - known_head[lane] >= DEPTH ->
#ifdef DROP_NEWEST
     d_step { gone[m]++; dropped++; is_refused = true }
#else
     oldest = MESSAGE_OF(slot_word[SLOT(lane, known_head[lane])]);
     atomic {
       if
#ifdef BUG_BLIND_DROP
       :: head[lane] = head[lane] + 1; gone[oldest]++; dropped++
#else
       :: head[lane] == known_head[lane] ->
          head[lane] = head[lane] + 1; known_head[lane] = head[lane]; gone[oldest]++; dropped++
       :: else -> known_head[lane] = head[lane]
#endif
       fi;
       oldest = 0
     }
#endif
  :: else
  fi;
  if
  :: is_refused -> is_refused = false
  :: else ->
#ifdef BUG_LAP_FIRST
     slot_word[SLOT(lane, place)] = WORD(m, place);
     slot_time[SLOT(lane, place)] = m;
#else
     slot_time[SLOT(lane, place)] = m;
     slot_word[SLOT(lane, place)] = WORD(m, place);
#endif
     place++;
     if
     :: tail[lane] = place
     :: true /* seen later */
     fi
  fi;
#ifndef BUG_MARK_FIRST
  mark_lane(lane);
#endif
  if
  :: tail[lane] != place -> tail[lane] = place
  :: else
  fi;
  d_step { returned = returned | FLAG(m); m = 0 }
}

proctype Publisher(byte lane; byte count) {
  byte m, oldest, old_state, i;
  byte place; /* `tail`, as its only writer knows it */
  bool is_refused;
#ifdef BUG_MARK_SKIPPED_EARLY
  bool was_set;
#endif
  do
  :: i < count -> push(lane); i++
  :: else -> break
  od;
  publishers_done++
}

/* Lane::peek. */
inline peek(lane) {
#if DEPTH > 1
  was_full = tail[lane] >= head[lane] + 2;
#endif
  do
  :: at = head[lane];
#ifdef BUG_EMPTY_BY_TAIL
     if
     :: at >= tail[lane] -> is_there = false; break
     :: else
     fi;
#endif
     word = slot_word[SLOT(lane, at)];
     if
#ifndef BUG_LAP_NOT_COMPARED
     :: (word & 1) != LAP(at) ->
        if
        :: head[lane] == at -> is_there = false; assert(!was_full); break
#ifdef BUG_EMPTY_BY_LAP
        :: else -> is_there = false; assert(!was_full); break
#else
        :: else
#endif
        fi
     :: else ->
#else
     :: true ->
#endif
        time = slot_time[SLOT(lane, at)];
        if
        :: head[lane] == at -> is_there = true; break
#ifdef BUG_LAP_ONLY
        :: else -> is_there = true; break
#else
        :: else
#endif
        fi
     fi
  od
}

/* The earliest of all that is looked at becomes `best`. */
inline compare() {
  d_step {
    if
    :: is_there ->
       assert(time == MESSAGE_OF(word));
       is_ready = true;
       if
       :: best_lane == NONE || time < best_time ->
          best_lane = lane; best_time = time; best_at = at; best_envelope = MESSAGE_OF(word)
       :: else
       fi
    :: else
    fi;
    at = 0; time = 0; word = 0; is_there = false; was_full = false
  }
}

#ifdef SHARED
/* The one of the heap that stands on top. */
inline find_first() {
  d_step {
    lane = SHARED_BIT;
    if
    :: !(held & FLAG(lane)) || ((held & FLAG(lane + 1)) && known_time[1] < known_time[0]) -> lane++
    :: else
    fi
  }
}

/* What `peek` found gives its lane another place in the heap; true if it was known. */
inline is_first_known() {
#ifdef BUG_SHARED_TIME_KEPT
  is_known = true;
#else
  d_step { is_known = (time == known_time[lane - SHARED_BIT]); known_time[lane - SHARED_BIT] = time }
#endif
}

/* SharedBit::peek. */
inline peek_shared() {
  do
  :: is_ready = false;
     do /* SharedBit::peek_held */
     :: held == 0 -> break
     :: else ->
        find_first();
        peek(lane);
        if
        :: is_there
        :: else ->
           marked = marked & ~FLAG(lane);
#ifndef BUG_SHARED_NO_SECOND_LOOK
           peek(lane);
           if
           :: is_there -> marked = marked | FLAG(lane)
           :: else
           fi
#endif
        fi;
        if
        :: is_there ->
           is_first_known();
           if
           :: is_known -> compare(); is_known = false; break
           :: else -> d_step { at = 0; time = 0; word = 0; is_there = false; was_full = false }
           fi
        :: else -> d_step { held = held & ~FLAG(lane); known_time[lane - SHARED_BIT] = 0; at = 0; word = 0; was_full = false }
        fi
     od;
     /* SharedBit::hold_marked: times not known yet are 0, no later than any. */
     atomic { held_before = held; held = held | marked }
#ifdef BUG_SHARED_ONE_LOOK
     if
     :: is_ready -> held = held_before; held_before = 0; break
     :: else
     fi;
#endif
     if
     :: held == held_before -> held_before = 0; break
     :: else -> held_before = 0
     fi
  od;
  lane = 0
}
#endif

/* Inbox::peek_bit. */
inline peek_bit(nr) {
#ifdef SHARED
  if
  :: nr == SHARED_BIT -> peek_shared()
  :: else -> d_step { is_ready = false; lane = nr } peek(lane); compare(); lane = 0
  fi
#else
  d_step { is_ready = false; lane = nr }
  peek(lane);
  compare();
  lane = 0
#endif
}

/* Inbox::peek_few. */
inline peek_few() {
  d_step { best_lane = NONE; best_at = 0; best_time = 0; best_envelope = 0; lane = 0 }
  do
  :: lane < LANES -> peek(lane); compare(); lane++
  :: else -> break
  od;
  atomic { lane = 0; is_ready = false }
}

inline deliver() {
  d_step {
    gone[best_envelope]++;
    delivered++;
    m = 0;
    do
    :: m < MESSAGES -> assert(!(before[best_envelope] & FLAG(m)) || gone[m] == 1); m++
    :: else -> break
    od;
    m = 0
  }
}

proctype Worker() {
  byte ready, seen, nr, lane, at, time, word, m;
  byte best_lane = NONE, best_at, best_time, best_envelope;
  bool is_there, was_full, is_ready;
#ifdef SHARED
  byte held, held_before, known_time[2];
  bool is_known;
#endif
#ifdef EARLY
  byte last_lane = NONE, last_at;
#endif

end_asleep:
#ifdef EARLY
  atomic {
    if
    :: queued -> goto begin
    :: publishers_done < LANES
    fi
  }
  peek_few();
  if
  :: best_lane == NONE -> goto end_asleep
  :: else
  fi;
#ifndef BUG_EARLY_ONE_LOOK
  d_step { last_lane = best_lane; last_at = best_at }
  peek_few();
  atomic {
    if
    :: best_lane == last_lane && best_at == last_at -> last_lane = NONE; last_at = 0
    :: else -> last_lane = NONE; last_at = 0; goto end_asleep
    fi
  }
#endif
  atomic {
    if
    :: head[best_lane] == best_at -> head[best_lane] = best_at + 1; assert(best_at <= tail[best_lane])
    :: else -> goto end_asleep
    fi
  }
  deliver();
#ifdef BUG_EARLY_CLEARS
  state = state & ~FLAG(BIT_OF(best_lane));
#endif
  goto end_asleep;
begin:
#endif
  atomic {
    queued -> queued = false;
    assert((state & RUNNING) == 0);
    state = state | RUNNING
  }
take:
  atomic {
    best_lane = NONE; best_at = 0; best_time = 0; best_envelope = 0;
    seen = 0; nr = 0;
    ready = state & LANE_MASK
  }
  if
  :: ready == 0 -> goto idle
  :: else
  fi;
  do
  :: nr < BITS && (ready & FLAG(nr)) ->
     peek_bit(nr);
     if
     :: is_ready -> seen = seen | FLAG(nr)
     :: else ->
        state = state & ~FLAG(nr);
#ifdef BUG_SHARED_CLEARED_LAST
        if
        :: nr != SHARED_BIT -> peek_bit(nr)
        :: else
        fi;
#elif !defined(BUG_NO_SECOND_LOOK)
        peek_bit(nr);
#endif
#ifndef BUG_NO_SECOND_LOOK
        if
        :: is_ready -> state = state | FLAG(nr); seen = seen | FLAG(nr)
        :: else
        fi
#endif
     fi;
     nr++
  :: nr < BITS && !(ready & FLAG(nr)) -> nr++
  :: else -> break
  od;
#ifndef BUG_WORD_READ_ONCE
  if
  :: (state & LANE_MASK & ~seen) -> goto take
  :: else
  fi;
#endif
  if
  :: best_lane == NONE -> goto idle
  :: else
  fi;
#ifdef BUG_BLIND_POP
  head[best_lane] = head[best_lane] + 1;
#else
  atomic {
    if
    :: head[best_lane] == best_at -> head[best_lane] = best_at + 1; assert(best_at <= tail[best_lane])
    :: else -> goto take
    fi
  }
#endif
#ifdef BUG_LATE_READ
  best_envelope = MESSAGE_OF(slot_word[SLOT(best_lane, best_at)]);
#endif
  deliver();
  goto take;
idle:
#ifdef BUG_BLIND_END
  state = 0;
  goto end_asleep;
#else
  atomic {
    if
    :: state == RUNNING -> state = 0; goto end_asleep
    :: else -> goto take
    fi
  }
#endif
}

init {
  byte m;
  atomic {
    run Publisher(0, N0);
    run Publisher(1, N1);
#if LANES > 2
    run Publisher(2, N2);
#endif
    run Worker()
  }
  publishers_done == LANES;
  timeout -> d_step {
    assert(state == 0 && !queued);
    do
    :: m < LANES -> assert(head[m] == tail[m]); m++
    :: else -> break
    od;
    assert(published == MESSAGES && published == delivered + dropped);
    m = 0;
    do
    :: m < MESSAGES -> assert(gone[m] == 1); m++
    :: else -> break
    od
  }
}
