/*
 * The word that says what a component has to do, and the workers that serve it.
 *
 * Mirrors  Inbox::mark, mark_control, begin, peek, take_bit, try_end_idle, end_early,
 *          try_end_unopened (src/broker/inbox.{h,cc}); Actor::run_turn, run_next, run_early,
 *          run_controls, put_in_front (src/executor/actor.cc); Executor::enqueue,
 *          run_ready, run_early (src/executor/executor.cc).
 * Leaves out  lanes: what waits is a count behind the lane's bit (inbox.pml has the lanes).
 *          Sleeping, and arming timers: a worker sees a ready component at once (eventcount.pml).
 *          Time: a timer that is due may be so before or after the message that waits. A turn ends
 *          early after TURN activations.
 * Checks   two workers never serve one component at once; when all is still, every message, tick
 *          and control cause was served: none is left behind in a component that is not queued,
 *          although it takes messages only once a control cause has opened it. ORDERED, EARLY: a
 *          message is served after each control cause that was posted before it was pushed.
 *
 * A control thread posts CONTROLS causes; the OPENING first of them open the component.
 * EARLY: the only worker also takes messages before they were marked, while it waits for the
 * component to be queued. It does not once all others have ended: what is left then, their marks
 * must bring.
 *
 * run short: two workers, messages and a tick        -DMESSAGES=2 -DTICKS=1
 * run short: two publishers                          -DMESSAGES=1 -DPUBLISHERS=2
 * run short: three causes                            -DCONTROLS=3 -DMESSAGES=1
 * run short: early                                   -DWORKERS=1 -DEARLY -DMESSAGES=1 -DTICKS=1
 * run short: early, causes while it is open          -DWORKERS=1 -DEARLY -DMESSAGES=2 -DCONTROLS=3 -DOPENING=1
 * run short: the order of causes and messages        -DORDERED -DMESSAGES=1 -DCONTROLS=2 -DOPENING=1
 * run long: order, two publishers                    -DORDERED -DMESSAGES=1 -DPUBLISHERS=2 -DCONTROLS=3 -DOPENING=1
 * run long: order, a tick                            -DORDERED -DMESSAGES=2 -DTICKS=1 -DOPENING=1
 * run long: early, two publishers                    -DWORKERS=1 -DEARLY -DMESSAGES=1 -DPUBLISHERS=2 -DCONTROLS=3 -DOPENING=1
 * run long: early, two components                    -DWORKERS=1 -DEARLY -DCOMPONENTS=2 -DMESSAGES=1 -DCONTROLS=1
 * run long: early, turns of two                      -DWORKERS=1 -DEARLY -DTURN=2 -DMESSAGES=3 -DTICKS=1 -DOPENING=1
 * run long: three workers                            -DWORKERS=3 -DMESSAGES=2 -DTICKS=1
 * run long: two publishers, two ticks                -DMESSAGES=2 -DPUBLISHERS=2 -DTICKS=2
 * run long: two components                           -DCOMPONENTS=2 -DMESSAGES=1 -DTICKS=1
 * run long: turns of two                             -DTURN=2 -DMESSAGES=3 -DTICKS=1 -DPUBLISHERS=2
 * bug BUG_NO_GATE: a worker does not heed that another serves the component  -DMESSAGES=2 -DTICKS=1
 * bug BUG_CONTROL_AS_MARK: a control cause queues only a quiet component     -DMESSAGES=1
 * bug BUG_EARLY_END_FORGETS: a turn that ends early does not queue again     -DMESSAGES=2
 * bug BUG_UNOPENED_END_BLIND: an unopened turn ends without a look at the control bit  -DMESSAGES=1
 * bug BUG_IDLE_END_BLIND: an idle turn ends without comparing the word       -DMESSAGES=1
 * bug BUG_BIT_TAKEN_LATE: the causes are taken before their bit is           -DMESSAGES=1
 * bug BUG_TICK_TAKEN_LATE: the timer's bit is taken after the timers were looked at  -DTICKS=2
 * bug BUG_TURN_BEFORE_CONTROLS: a turn does not look whether causes came before a message  -DORDERED -DMESSAGES=1 -DOPENING=1
 * bug BUG_EARLY_SHARED: two workers serve early                              -DEARLY -DMESSAGES=2 -DOPENING=1
 * bug BUG_EARLY_UNOPENED: a component is served early that is not open       -DWORKERS=1 -DEARLY -DMESSAGES=1
 * bug BUG_EARLY_BEFORE_CONTROLS: no look whether control causes wait         -DWORKERS=1 -DEARLY -DMESSAGES=1 -DOPENING=1
 * bug BUG_EARLY_CONTROLS_FIRST: that look goes before the look at the lane   -DWORKERS=1 -DEARLY -DMESSAGES=1 -DOPENING=1
 * bug BUG_CONTROLS_CLEARED_LATE: that none waits is said after they have run  -DWORKERS=1 -DEARLY -DMESSAGES=1 -DCONTROLS=3 -DOPENING=1
 * bug BUG_CONTROLS_SET_LATE: that one waits is said after it was posted      -DWORKERS=1 -DEARLY -DMESSAGES=1 -DOPENING=1
 * bug BUG_EARLY_CLEARS: who serves a message early clears the lane's bit     -DWORKERS=1 -DEARLY -DMESSAGES=2 -DOPENING=1
 */
#ifndef WORKERS
#define WORKERS 2
#endif
#ifndef COMPONENTS
#define COMPONENTS 1
#endif
#ifndef PUBLISHERS
#define PUBLISHERS 1
#endif
#ifndef MESSAGES
#define MESSAGES 0
#endif
#ifndef TICKS
#define TICKS 0
#endif
#ifndef CONTROLS
#define CONTROLS 2
#endif
#ifndef OPENING
#define OPENING CONTROLS
#endif
#ifndef TURN
#define TURN 1
#endif

#define FLAG(i) (1 << (i))
#define LANE 1
#define TIMER 2
#define CONTROL 4
#define RUNNING 8

byte ready = 0;         /* Executor::ready_ */
byte state[COMPONENTS]; /* Inbox::state_ */
bool is_open[COMPONENTS], has_controls[COMPONENTS];
byte messages[COMPONENTS], ticks[COMPONENTS], controls[COMPONENTS]; /* what waits */

/* What is observed. */
byte serving[COMPONENTS], controls_served[COMPONENTS];
byte writers_ended = 0;
#define WRITERS (COMPONENTS * (PUBLISHERS + 2))
#if defined(EARLY) || defined(ORDERED)
#define CHECKS_ORDER
byte posted[COMPONENTS]; /* control causes whose `post` has returned */
byte pushed[COMPONENTS], popped[COMPONENTS];
byte posted_before[COMPONENTS * MESSAGES * PUBLISHERS]; /* that each message was pushed */
#define NR(component, message) ((component) * MESSAGES * PUBLISHERS + (message))
#define note_push(component) \
  posted_before[NR(component, pushed[component])] = posted[component]; pushed[component]++
#define note_pop(component) popped[component]++
#define note_post(component) posted[component]++
#else
#define note_push(component)
#define note_pop(component)
#define note_post(component)
#endif

#define enqueue(component) ready = ready | FLAG(component)

inline mark(component, bits) {
  if
  :: (state[component] & bits) == bits /* set already: nothing to write */
  :: else ->
     atomic { was = state[component]; state[component] = was | bits }
     if
     :: was == 0 -> enqueue(component)
     :: else
     fi;
     was = 0
  fi
}

inline mark_control(component) {
#ifdef BUG_CONTROL_AS_MARK
  mark(component, CONTROL)
#else
  state[component] = state[component] | CONTROL;
  enqueue(component)
#endif
}

/* `is_taken`: whether one of `bits` was set. */
inline take_bit(component, bits) {
  is_taken = (state[component] & bits) != 0;
  if
  :: is_taken ->
     atomic { is_taken = (state[component] & bits) != 0; state[component] = state[component] & ~bits }
  :: else
  fi
}


inline run_controls(component) {
  atomic {
    controls_served[component] = controls_served[component] + controls[component];
    controls[component] = 0;
#ifndef BUG_CONTROLS_CLEARED_LATE
    has_controls[component] = false
#endif
  }
  is_open[component] = is_open[component] || controls_served[component] >= OPENING;
#ifdef BUG_CONTROLS_CLEARED_LATE
  has_controls[component] = false
#endif
}

#ifdef CHECKS_ORDER
#define check_order(component) \
  assert(controls_served[component] >= posted_before[NR(component, popped[component])])
#else
#define check_order(component)
#endif

#define pop(component) messages[component]--; note_pop(component)

/* One tick or message, if there is one. */
inline run_next(component) {
  do
  :: do
     :: (state[component] & LANE) ->
        if
        :: messages[component] > 0 -> has_message = true; break
        :: else
        fi;
        state[component] = state[component] & ~LANE;
        if
        :: messages[component] > 0 ->
           state[component] = state[component] | LANE; has_message = true; break
        :: else
        fi
     :: else -> break
     od;
     if
#ifdef BUG_TURN_BEFORE_CONTROLS
     :: true -> break
#else
     :: has_message && has_controls[component] -> has_message = false; run_controls(component)
     :: else -> break
#endif
     fi
  od;
  atomic {
    if
    :: ticks[component] > 0 ->
       ticks[component] = 0; has_run = true /* what is late replaces the ticks that it missed */
    :: has_message -> check_order(component); pop(component); has_run = true
    :: ticks[component] == 0 && !has_message
    fi;
    has_message = false
  }
}

#if defined(EARLY) && (WORKERS == 1 || defined(BUG_EARLY_SHARED))
#define LOOKS_EARLY
#endif

inline run_early(component) {
#ifdef BUG_EARLY_CONTROLS_FIRST
  may_run = !has_controls[component];
#else
  may_run = true;
#endif
  may_run = may_run && messages[component] > 0;
#ifndef BUG_EARLY_UNOPENED
  may_run = may_run && is_open[component];
#endif
#if !defined(BUG_EARLY_BEFORE_CONTROLS) && !defined(BUG_EARLY_CONTROLS_FIRST)
  may_run = may_run && !has_controls[component];
#endif
  may_run = may_run && ticks[component] == 0;
  if
  :: may_run ->
     atomic { serving[component]++; assert(serving[component] == 1 && is_open[component]) }
     atomic {
       check_order(component);
       pop(component)
     }
#ifdef BUG_EARLY_CLEARS
     state[component] = state[component] & ~LANE;
#endif
     serving[component]--
  :: else
  fi;
  may_run = false
}

proctype Worker() {
  byte c, was, count;
  bool is_taken, has_run, has_message, may_run;

end_asleep:
  do
  :: atomic { ready != 0 -> c = 0 }
     do
     :: c < COMPONENTS ->
        atomic { is_taken = (ready & FLAG(c)) != 0; ready = ready & ~FLAG(c) }
        if
        :: !is_taken -> goto next_one
        :: else
        fi;
        /* Actor::run_turn */
        atomic { was = state[c]; state[c] = was | RUNNING }
#ifndef BUG_NO_GATE
        if
        :: (was & RUNNING) -> goto next_one
        :: else
        fi;
#endif
        atomic { was = 0; count = 0; serving[c]++; assert(serving[c] == 1) }
again:
#ifdef BUG_BIT_TAKEN_LATE
        if
        :: (state[c] & CONTROL) -> run_controls(c); take_bit(c, CONTROL); goto again
        :: else
        fi;
#else
        take_bit(c, CONTROL);
        if
        :: is_taken -> run_controls(c); goto again
        :: else
        fi;
#endif
        if
        :: !is_open[c] ->
#ifdef BUG_UNOPENED_END_BLIND
           atomic { state[c] = state[c] & ~RUNNING; serving[c]--; goto next_one }
#else
           was = state[c];
           do
           :: (was & CONTROL) -> goto again
           :: else ->
              atomic {
                if
                :: state[c] == was -> state[c] = was & ~RUNNING; serving[c]--; goto next_one
                :: else -> was = state[c]
                fi
              }
           od
#endif
        :: else
        fi;
        if
        :: count == TURN ->
           atomic { state[c] = state[c] & ~RUNNING; was = state[c]; serving[c]-- }
#ifndef BUG_EARLY_END_FORGETS
           if
           :: was != 0 -> enqueue(c)
           :: else
           fi;
#endif
           goto next_one
        :: else
        fi;
#ifndef BUG_TICK_TAKEN_LATE
        take_bit(c, TIMER);
#endif
        run_next(c);
#ifdef BUG_TICK_TAKEN_LATE
        take_bit(c, TIMER);
#endif
        if
        :: has_run -> has_run = false; count++; goto again
        :: else
        fi;
#ifdef BUG_IDLE_END_BLIND
        atomic { state[c] = 0; serving[c]-- }
#else
        atomic {
          if
          :: state[c] == RUNNING -> state[c] = 0; serving[c]--
          :: else -> goto again
          fi
        }
#endif
next_one:
        atomic { c++; was = 0; count = 0; is_taken = false }
     :: else -> break
     od;
     c = 0
#ifdef LOOKS_EARLY
  :: atomic { writers_ended < WRITERS -> c = 0 }
     do
     :: c < COMPONENTS -> run_early(c); c++
     :: else -> break
     od;
     c = 0
#endif
  od
}

proctype Publisher(byte c) {
  byte was, i;
  do
  :: i < MESSAGES ->
     atomic { messages[c]++; note_push(c) }
     mark(c, LANE);
     i++
  :: else -> break
  od;
  writers_ended++
}

/* Executor::fire_timers: the bit is set without a wake call. */
proctype Clock(byte c) {
  byte was, i;
  do
  :: i < TICKS -> ticks[c]++; mark(c, TIMER); i++
  :: else -> break
  od;
  writers_ended++
}

proctype ControlThread(byte c) {
  byte was, i;
  do
  :: i < CONTROLS ->
#ifdef BUG_CONTROLS_SET_LATE
     controls[c]++;
     mark_control(c);
     note_post(c);
     has_controls[c] = true;
#else
     atomic { controls[c]++; has_controls[c] = true }
     mark_control(c);
     note_post(c);
#endif
     i++
  :: else -> break
  od;
  writers_ended++
}

init {
  byte i, c;
  atomic {
    do
    :: c < COMPONENTS ->
       i = 0;
       do
       :: i < PUBLISHERS -> run Publisher(c); i++
       :: else -> break
       od;
       run Clock(c);
       run ControlThread(c);
       c++
    :: else -> break
    od;
    i = 0;
    do
    :: i < WORKERS -> run Worker(); i++
    :: else -> break
    od;
    c = 0
  }
  timeout -> d_step {
    assert(writers_ended == WRITERS);
    assert(ready == 0);
    do
    :: c < COMPONENTS ->
       assert(state[c] == 0 && serving[c] == 0);
       assert(messages[c] == 0 && ticks[c] == 0);
       assert(controls[c] == 0 && controls_served[c] == CONTROLS);
       c++
    :: else -> break
    od
  }
}
