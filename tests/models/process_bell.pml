/*
 * The bell: how workers of one process sleep until another process publishes.
 *
 * Mirrors  ringing after a push, and sleeping by futex_waitv on the bells of all publishing processes and
 *          the executor's own word (src/processes, base::Sleepers), as docs/memory_order.md describes it
 *          under "Between processes".
 * Leaves out  the lanes: what was pushed is a count, of which a worker takes one in one step, as the
 *          running bit of a component sees to (remote_lane.pml, inbox.pml). Timers and the leader
 *          (eventcount.pml). A futex that returns for no reason, after which a worker looks again. The
 *          bell's 32 bits come round after 4 billion messages in one look of a worker.
 * Checks   when all is still, and although some workers are kept busy for good: no worker sleeps
 *          while a message waits (no lost wake-up); `sleepers` is the number of those who sleep.
 *
 * The bell is the publisher's word, mapped read-only by the receiver; `sleepers` the receiver's. A
 * futex wait puts the worker to sleep only if every word has the value that was read before; from
 * then on only a wake-up ends it, not a value.
 *
 * PUBLISHERS processes push MESSAGES each; a component of the process itself makes LOCALS other work. LONGS
 * turns may last for good. LAZY: the publisher rings only if somebody sleeps.
 *
 * run short: two workers, two messages             -DMESSAGES=2
 * run short: two publishers, a turn that lasts     -DPUBLISHERS=2 -DMESSAGES=1 -DLONGS=1
 * run short: work of the process itself            -DMESSAGES=1 -DLOCALS=1 -DLONGS=1
 * run short: one worker                            -DWORKERS=1 -DMESSAGES=3
 * run short: the bell is rung for sleepers only    -DLAZY -DMESSAGES=2 -DLONGS=1
 * run long: three messages, a turn that lasts      -DMESSAGES=3 -DLONGS=1
 * run long: two publishers, two each               -DPUBLISHERS=2 -DMESSAGES=2 -DLONGS=1
 * run long: all of it                              -DPUBLISHERS=2 -DMESSAGES=2 -DLOCALS=2 -DLONGS=1
 * run long: three workers, two turns that last     -DWORKERS=3 -DMESSAGES=3 -DLONGS=2 -DLOCALS=1
 * run long: rung for sleepers only, all of it      -DLAZY -DPUBLISHERS=2 -DMESSAGES=2 -DLOCALS=1 -DLONGS=1
 * bug BUG_LOOKS_FIRST: a worker looks for messages, then announces that it sleeps          -DMESSAGES=1
 * bug BUG_BELL_READ_LATE: a worker reads the bell after it looked for messages             -DMESSAGES=1
 * bug BUG_RINGS_FIRST: the publisher rings, then pushes                                    -DMESSAGES=1
 * bug BUG_SLEEPERS_READ_FIRST: the publisher looks for sleepers, then pushes               -DMESSAGES=1
 * bug BUG_SILENT_BELL: the publisher wakes without a new value of the bell                 -DMESSAGES=1
 * bug BUG_SLEEPERS_FLAG: `sleepers` is a flag, which the first that wakes takes away       -DMESSAGES=2 -DLONGS=1
 * bug BUG_ONE_BELL: a worker waits for one of the bells                                    -DPUBLISHERS=2 -DMESSAGES=1
 * bug BUG_NOT_PASSED_ON: who takes one of several messages wakes nobody for the others     -DMESSAGES=2 -DLONGS=1 -DLOCALS=1
 */
#ifndef PUBLISHERS
#define PUBLISHERS 1
#endif
#ifndef WORKERS
#define WORKERS 2
#endif
#ifndef LOCALS
#define LOCALS 0
#endif
#ifndef LONGS
#define LONGS 0
#endif
#define FLAG(i) (1 << (i))
#define WORDS (PUBLISHERS + 1) /* the bells, and the worker's own word */

byte pushed[PUBLISHERS]; /* and not taken yet */
byte bell[PUBLISHERS];
byte sleepers = 0;       /* the receiving process's word, for publishers */
byte own_work = 0;       /* work of the process itself that is ready */
byte announced = 0;      /* Sleepers::sleeping_, for wakers in the process */
bool is_woken[WORKERS];  /* the worker's own word */

byte waiting[WORKERS];   /* the kernel's: the words on which it waits, as bits; 0: it does not */
#define OWN_WORD FLAG(PUBLISHERS)

/* What is observed. */
byte longs = LONGS, busy_for_good = 0;

/* FUTEX_WAKE of one waiter. */
inline wake_bell(publisher) {
  atomic {
    if
    :: waiting[0] & FLAG(publisher) -> waiting[0] = 0
#if WORKERS > 1
    :: waiting[1] & FLAG(publisher) -> waiting[1] = 0
#endif
#if WORKERS > 2
    :: waiting[2] & FLAG(publisher) -> waiting[2] = 0
#endif
    :: else
    fi
  }
}

/* Sleepers::wake_one. */
inline wake_one() {
  atomic {
    chosen = 0;
    do
    :: chosen < WORKERS && !(announced & FLAG(chosen)) -> chosen++
    :: else -> break
    od;
    if
    :: chosen < WORKERS -> announced = announced & ~FLAG(chosen)
    :: else
    fi
  }
  if
  :: chosen < WORKERS ->
     is_woken[chosen] = true;
     d_step {
       if
       :: waiting[chosen] & OWN_WORD -> waiting[chosen] = 0
       :: else
       fi
     }
  :: else
  fi;
  chosen = 0
}

proctype Publisher(byte self) {
  byte i;
#ifdef BUG_SLEEPERS_READ_FIRST
  bool has_sleepers;
#endif
  do
  :: i < MESSAGES ->
#ifdef BUG_SLEEPERS_READ_FIRST
     has_sleepers = sleepers != 0;
#endif
#ifdef BUG_RINGS_FIRST
     bell[self]++;
#endif
     pushed[self]++;
#if !defined(BUG_RINGS_FIRST) && !defined(BUG_SILENT_BELL) && !defined(LAZY)
     bell[self]++;
#endif
     if
#ifdef BUG_SLEEPERS_READ_FIRST
     :: has_sleepers ->
#else
     :: sleepers != 0 ->
#endif
#ifdef LAZY
        bell[self]++;
#endif
        wake_bell(self)
     :: else
     fi;
     i++
  :: else -> break
  od
}

/* Work that a component of the process makes ready. */
proctype Local() {
  byte i, chosen;
  do
  :: i < LOCALS -> own_work++; wake_one(); i++
  :: else -> break
  od
}

/* Takes one piece of work; `is_taken` says whether there was one. */
inline take() {
  place = 0;
  is_taken = false;
  do
  :: place < PUBLISHERS && !is_taken ->
     atomic {
       if
       :: pushed[place] > 0 -> pushed[place]--; is_taken = true
       :: else
       fi
     }
     place++
  :: else -> break
  od;
  if
  :: !is_taken ->
     atomic {
       if
       :: own_work > 0 -> own_work--; is_taken = true
       :: else
       fi
     }
  :: else
  fi;
  place = 0
}

/* Whether there is more. */
inline look() {
  place = 0;
  is_there = false;
  do
  :: place < PUBLISHERS && !is_there -> is_there = pushed[place] > 0; place++
  :: else -> break
  od;
  if
  :: !is_there -> is_there = own_work > 0
  :: else
  fi;
  place = 0
}

inline announce() {
  atomic { is_woken[self] = false; announced = announced | FLAG(self) }
#ifdef BUG_SLEEPERS_FLAG
  sleepers = 1
#else
  sleepers++
#endif
}

inline leave() {
#ifdef BUG_SLEEPERS_FLAG
  sleepers = 0;
#else
  atomic { assert(sleepers > 0); sleepers-- }
#endif
  atomic { was_chosen = !(announced & FLAG(self)); announced = announced & ~FLAG(self) }
  if
  :: was_chosen -> is_woken[self] /* that wake-up is on its way */
  :: else
  fi;
  was_chosen = false
}

inline read_bells() {
  place = 0;
  do
  :: place < PUBLISHERS -> seen[place] = bell[place]; place++
  :: else -> break
  od;
  place = 0
}

proctype Worker(byte self) {
  byte seen[PUBLISHERS], place, chosen;
  bool is_taken, is_there, was_chosen;
  do
  :: take();
     if
     :: is_taken ->
        is_taken = false;
#ifndef BUG_NOT_PASSED_ON
        look();
        if
        :: is_there -> is_there = false; wake_one()
        :: else
        fi;
#endif
        if
        :: atomic { longs > 0 -> longs--; busy_for_good++ }
           break
        :: true
        fi
     :: else ->
#ifdef BUG_LOOKS_FIRST
        look();
        announce();
        read_bells();
#else
        announce();
#ifndef BUG_BELL_READ_LATE
        read_bells();
#endif
        look();
#ifdef BUG_BELL_READ_LATE
        read_bells();
#endif
#endif
        if
        :: is_there -> is_there = false
        :: else ->
           d_step { /* futex_waitv */
             waiting[self] = OWN_WORD;
             place = 0;
             do
#ifdef BUG_ONE_BELL
             :: place < 1 ->
#else
             :: place < PUBLISHERS ->
#endif
                waiting[self] = waiting[self] | FLAG(place);
                if
                :: bell[place] != seen[place] -> waiting[self] = 0; break
                :: else
                fi;
                place++
             :: else -> break
             od;
             if
             :: is_woken[self] -> waiting[self] = 0
             :: else
             fi;
             place = 0
           }
end_asleep:
           waiting[self] == 0
        fi;
        leave();
        place = 0;
        do /* so that what was read is forgotten */
        :: place < PUBLISHERS -> seen[place] = 0; place++
        :: else -> break
        od;
        place = 0
     fi
  od
}

init {
  byte i;
  atomic {
    do
    :: i < PUBLISHERS -> run Publisher(i); i++
    :: else -> break
    od;
    i = 0;
    do
    :: i < WORKERS -> run Worker(i); i++
    :: else -> break
    od;
#if LOCALS
    run Local();
#endif
    i = 0
  }
  timeout -> d_step {
    do
    :: i < PUBLISHERS -> assert(pushed[i] == 0 || busy_for_good == WORKERS); i++
    :: else -> break
    od;
    assert(own_work == 0 || busy_for_good == WORKERS);
#ifndef BUG_SLEEPERS_FLAG
    assert(sleepers + busy_for_good == WORKERS);
#endif
    i = 0
  }
}
