/*
 * Workers that sleep, who wakes them, and the one among them that watches the timers.
 *
 * Mirrors  Sleepers (src/base/sleepers.{h,cc}); Executor::enqueue, wake, timer_armed, has_work,
 *          work, run_ready, fire_timers, lead, stop_leading, idle, stop (src/executor/executor.cc);
 *          Actor::publish_due, armed_due_ns, take_due (src/executor/actor.{h,cc}).
 * Leaves out  most of a turn: here it may arm its timer, publish to the next component, or keep
 *          its worker busy for good. Jobs, which are one more kind of work behind the same
 *          wake_one(). Spinning before sleeping, which sleeps later and no otherwise. A futex
 *          returns when its word is not 0 or when its time is over; what returns for no other
 *          reason looks again and changes nothing.
 * Checks   when all is still, and although some workers are kept busy for good: no worker sleeps
 *          while a component is ready (no lost wake-up) or while a timer is armed (none is
 *          unwatched); a wake-up is consumed once: nobody announces itself while one is left; all
 *          workers end when they are told to.
 *
 * A publisher makes the first BURST components ready with one wake call, then each other one with
 * another. Component 0 may arm its timer ARMS times. LONGS turns may last for good. EARLY_CLOCK: a
 * turn may have read the clock before a timer was due that fired.
 *
 * run short: a burst for two workers                -DBURST=2 -DCOMPONENTS=2
 * run short: messages are handed over, one turn lasts        -DHAND_OVER -DARMS=1 -DLONGS=1
 * run short: components in two words of the mask    -DWORDS=2 -DBURST=2 -DLONGS=1
 * run short: all workers end                        -DSTOP -DARMS=1 -DCOMPONENTS=1
 * run short: a single worker                        -DWORKERS=1 -DARMS=2 -DCOMPONENTS=3 -DEND=3 -DEARLY_CLOCK
 * run long: one turn lasts, another component has a timer    -DARMS=1 -DLONGS=1
 * run long: handed over, the clock read early       -DHAND_OVER -DARMS=1 -DLONGS=1 -DEARLY_CLOCK
 * run long: a burst and one more                    -DBURST=2 -DCOMPONENTS=3 -DLONGS=1
 * run long: a timer armed twice                     -DARMS=2 -DLONGS=1 -DEND=3
 * run long: three workers, two of them kept busy    -DWORKERS=3 -DARMS=1 -DLONGS=2 -DCOMPONENTS=1
 * run long: two words, a timer                      -DWORDS=2 -DBURST=2 -DLONGS=1 -DARMS=1
 * run long: three workers and a burst of three      -DWORKERS=3 -DBURST=3 -DCOMPONENTS=3 -DLONGS=2
 * bug BUG_LOOKS_FIRST: a worker looks for work, then announces itself          -DBURST=2
 * bug BUG_WAKES_FIRST: who has work wakes, then puts the work in place         -DBURST=2
 * bug BUG_NOT_PASSED_ON: who takes one of several wakes nobody for the others  -DBURST=2 -DLONGS=1
 * bug BUG_ONE_WORD: it looks for the others in its own word of the mask only   -DWORDS=2 -DBURST=2 -DLONGS=1
 * bug BUG_TIMES_OUT_BLINDLY: a sleeper whose time is over ignores its waker    -DARMS=1
 * bug BUG_LEADS_BLINDLY: the leader does not look again at the earliest timer, and whoever arms one wakes nobody  -DARMS=1 -DCOMPONENTS=1 -DBUG_NOBODY_LEADS
 * bug BUG_NOBODY_LEADS: a timer is armed while others sleep and nobody leads   -DHAND_OVER -DARMS=1 -DLONGS=1
 * bug BUG_LEAVES_QUIETLY: the leader wakes no successor      -DARMS=2 -DLONGS=1 -DEND=3
 * bug BUG_CLEARED_LATE: the earliest time is forgotten after the timers were looked at  -DARMS=2 -DEND=3 -DCOMPONENTS=1
 */
#ifndef WORKERS
#define WORKERS 2
#endif
#ifndef COMPONENTS
#define COMPONENTS 2
#endif
#ifndef BURST
#define BURST 1
#endif
#ifndef WORDS
#define WORDS 1
#endif
#ifndef ARMS
#define ARMS 0
#endif
#ifndef LONGS
#define LONGS 0
#endif
#ifndef END
#define END 2 /* when the clock stops: every timer is due by then */
#endif

#define FLAG(i) (1 << (i))
#define WORD_OF(component) ((component) % WORDS)
#define NOBODY WORKERS
#define NEVER 255
#define NOBODY_LEADS 0 /* earlier than any time */
#define SOMETHING 1
#define RUNNING 2

byte now = 1;

/* Sleepers */
byte sleeping = 0;
byte preferred_last = NOBODY; /* Sleepers::leader_ */
bool is_woken[WORKERS];

/* Executor */
byte ready[WORDS];
byte earliest = NEVER; /* earliest_due_ns_ */
byte leader = NOBODY;
byte leader_deadline = NOBODY_LEADS;
bool is_stopping = false;

/* Actors */
byte state[COMPONENTS]; /* the inbox's word: SOMETHING and RUNNING */
byte due[COMPONENTS];   /* the earliest of its timers */
byte armed[COMPONENTS]; /* DueTime */

/* What is observed. */
byte arms[COMPONENTS];
byte longs = LONGS, busy_for_good = 0;
byte workers_ended = 0;
bool publisher_ended = false;

inline wake(index, result) {
  atomic { result = (sleeping & FLAG(index)) != 0; sleeping = sleeping & ~FLAG(index) }
  if
  :: result -> is_woken[index] = true
  :: else
  fi
}

inline wake_one() {
  seen = sleeping;
  do
  :: seen == 0 -> break
  :: else ->
     atomic {
       others = seen;
       if
       :: preferred_last != NOBODY -> others = others & ~FLAG(preferred_last)
       :: else
       fi;
       if
       :: others == 0 -> others = seen
       :: else
       fi;
       chosen = 0;
       do
       :: (others & FLAG(chosen)) -> break
       :: else -> chosen++
       od;
       others = 0
     }
     wake(chosen, is_taken);
     if
     :: is_taken -> break
     :: else -> seen = sleeping
     fi
  od;
  atomic { seen = 0; chosen = 0; is_taken = false }
}

/* Inbox::mark */
inline mark(component) {
  if
  :: (state[component] & SOMETHING) /* set already: nothing to write */
  :: else ->
     atomic { was = state[component]; state[component] = was | SOMETHING }
     if
     :: was == 0 -> ready[WORD_OF(component)] = ready[WORD_OF(component)] | FLAG(component)
     :: else
     fi;
     was = 0
  fi
}

inline timer_armed(time) {
  known = earliest;
  do
  :: time < known ->
     atomic {
       if
       :: earliest == known -> earliest = time; break
       :: else -> known = earliest
       fi
     }
  :: else -> break
  od;
  known = leader_deadline;
  if
#ifndef BUG_NOBODY_LEADS
  :: known == NOBODY_LEADS -> wake_one()
#endif
  :: known > time ->
     known = leader;
     if
     :: known != NOBODY -> wake(known, is_taken)
     :: else
     fi
  :: else
  fi;
  atomic { known = 0; is_taken = false }
}

inline fire_timers() {
  has_fired = false;
  atomic { from = earliest; has_fired = from <= now }
  if
  :: has_fired ->
#ifndef BUG_CLEARED_LATE
     earliest = NEVER;
#endif
     atomic { has_fired = false; next = NEVER; fired_at = now; actor = 0 }
     do
     :: actor < COMPONENTS ->
        from = armed[actor];
        if
        :: from > fired_at ->
           if
           :: from < next -> next = from
           :: else
           fi
        :: else ->
           atomic {
             is_taken = armed[actor] == from;
             if
             :: is_taken -> armed[actor] = NEVER; has_fired = true
             :: else
             fi
           }
           if
           :: is_taken -> mark(actor)
           :: else
           fi;
           is_taken = false
        fi;
        actor++
     :: else -> break
     od;
#ifdef BUG_CLEARED_LATE
     earliest = NEVER;
#endif
     if
     :: next != NEVER -> timer_armed(next)
     :: else
     fi;
     atomic { next = 0; fired_at = 0; actor = 0 }
  :: else
  fi;
  from = 0
}

/* A turn of `component`: Actor::run_turn, its inbox being just "something". */
inline run_turn(component) {
  atomic { assert((state[component] & RUNNING) == 0); state[component] = state[component] | RUNNING }
  do
  :: state[component] = state[component] & ~SOMETHING;
     atomic {
       if
       :: due[component] <= now -> due[component] = NEVER /* a tick */
#ifdef EARLY_CLOCK
       :: true /* or the turn read the clock too early to see it */
#else
       :: else
#endif
       fi;
       if
       :: arms[component] > 0 && now < END -> arms[component]--; due[component] = now + 1
       :: true
       fi
     }
     if
     :: atomic { longs > 0 -> longs--; busy_for_good++ }
end_busy:
        false
     :: true
     fi;
#ifdef HAND_OVER
     if
     :: component + 1 < COMPONENTS -> mark(component + 1)
     :: else
     fi;
#endif
     if
     :: due[component] != armed[component] ->
        armed[component] = due[component];
        if
        :: due[component] != NEVER -> timer_armed(due[component])
        :: else
        fi
     :: else
     fi;
     atomic {
       if
       :: state[component] == RUNNING -> state[component] = 0; break
       :: else
       fi
     }
  od
}

inline is_anything_ready() {
  word = 0; has_work = false;
  do
  :: word < WORDS && !has_work -> has_work = ready[word] != 0; word++
  :: else -> break
  od;
  word = 0
}

inline run_ready() {
  i = 0; has_run = false;
  do
  :: i < WORDS ->
     atomic { word = (i + me) % WORDS; bits = ready[word]; nr = 0 }
     do
     :: bits == 0 -> break
     :: bits != 0 && !(bits & FLAG(nr)) -> nr++
     :: bits != 0 && (bits & FLAG(nr)) ->
        atomic {
          bits = bits & ~FLAG(nr);
          is_taken = (ready[word] & FLAG(nr)) != 0;
          ready[word] = ready[word] & ~FLAG(nr)
        }
        if
        :: is_taken ->
           is_taken = false;
#ifndef BUG_NOT_PASSED_ON
#ifdef BUG_ONE_WORD
           has_work = ready[word] != 0;
#else
           is_anything_ready();
           word = (i + me) % WORDS;
#endif
           if
           :: has_work -> wake_one()
           :: else
           fi;
#endif
           run_turn(nr);
           has_run = true;
           fire_timers()
        :: else
        fi
     od;
     i++
  :: else -> break
  od;
  atomic { i = 0; word = 0; bits = 0; nr = 0; has_work = false; has_fired = false }
}

inline take_off() {
  atomic { is_taken = (sleeping & FLAG(me)) != 0; sleeping = sleeping & ~FLAG(me) }
}

/* A single worker leads for ever. */
inline lead() {
  deadline = NEVER;
#if WORKERS == 1
  is_taken = true;
#else
  atomic {
    is_taken = leader == NOBODY;
    if
    :: is_taken -> leader = me
    :: else
    fi
  }
#endif
  if
  :: is_taken ->
#if WORKERS > 1
     preferred_last = me;
#endif
     deadline = earliest;
     do
     :: leader_deadline = deadline;
#ifdef BUG_LEADS_BLINDLY
        break
#else
        known = earliest;
        if
        :: known >= deadline -> break
        :: else -> deadline = known
        fi
#endif
     od;
     known = 0
  :: else
  fi;
  is_taken = false
}

inline stop_leading() {
  if
  :: has_led ->
     leader_deadline = NOBODY_LEADS;
     preferred_last = NOBODY;
     leader = NOBODY
  :: else
  fi
}

inline announce() {
  atomic { assert(!is_woken[me]); sleeping = sleeping | FLAG(me) }
}

proctype Worker(byte me) {
  byte seen, others, chosen, was, known, from, next, fired_at, actor;
  byte i, word, bits, nr, deadline;
  bool is_taken, has_fired, has_run, has_work, has_led;

  do
  :: is_stopping -> break
  :: else ->
     run_ready();
     fire_timers();
     if
     :: has_run || has_fired -> has_run = false; has_fired = false; goto again
     :: else
     fi;
     /* idle */
#ifdef BUG_LOOKS_FIRST
     is_anything_ready();
     announce();
     lead();
#else
     announce();
     lead();
     is_anything_ready();
#endif
     if
     :: has_work || is_stopping ->
        /* withdraw */
        has_work = false;
        take_off();
        if
        :: !is_taken -> is_woken[me]; is_woken[me] = false
        :: else
        fi
     :: else ->
        /* sleep */
end_asleep:
        do
        :: atomic { is_woken[me] -> is_woken[me] = false; break }
        :: deadline != NEVER && now >= deadline && !is_woken[me] ->
           take_off();
           if
#ifdef BUG_TIMES_OUT_BLINDLY
           :: true -> break
#else
           :: is_taken -> break
           :: else -> deadline = NEVER
#endif
           fi
        od
     fi;
     atomic { is_taken = false; deadline = 0; has_led = WORKERS > 1 && leader == me }
     stop_leading();
     if
     :: has_led ->
        has_led = false;
#ifndef BUG_LEAVES_QUIETLY
        if
        :: earliest != NEVER -> wake_one()
        :: else
        fi
#endif
     :: else
     fi;
again:
     skip
  od;
  workers_ended++
}

proctype Publisher() {
  byte seen, others, chosen, was, component;
  bool is_taken;
#ifdef BUG_WAKES_FIRST
  wake_one();
#endif
  do
  :: component < BURST -> mark(component); component++
  :: else -> break
  od;
#ifndef BUG_WAKES_FIRST
  wake_one();
#endif
#ifndef HAND_OVER
  do
  :: component < COMPONENTS -> mark(component); wake_one(); component++
  :: else -> break
  od;
#endif
#ifdef STOP
  is_stopping = true;
  component = 0;
  do
  :: component < WORKERS -> wake(component, is_taken); component++
  :: else -> break
  od;
#endif
  publisher_ended = true
}

proctype Clock() {
  do
  :: now < END -> now++
  :: else -> break
  od
}

init {
  byte i;
  atomic {
    do
    :: i < COMPONENTS -> due[i] = NEVER; armed[i] = NEVER; i++
    :: else -> break
    od;
    arms[0] = ARMS;
#if WORKERS == 1
    leader = 0;
#endif
    i = 0;
    do
    :: i < WORKERS -> run Worker(i); i++
    :: else -> break
    od;
    run Publisher();
    run Clock()
  }
  timeout -> d_step {
    assert(publisher_ended && now == END);
#ifdef STOP
    assert(workers_ended == WORKERS);
#endif
    i = 0;
    do
    :: i < COMPONENTS && busy_for_good + workers_ended < WORKERS ->
       assert((ready[WORD_OF(i)] & FLAG(i)) == 0);
       assert((state[i] & RUNNING) || (state[i] == 0 && armed[i] == NEVER));
       i++
    :: else -> break
    od
  }
}
