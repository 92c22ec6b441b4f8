/*
 * The word that says what a component has to do, and the workers that serve it.
 *
 * Mirrors  Inbox::mark, mark_control, begin, peek, take_bit, take_ready, try_end_idle, end_early,
 *          try_end_unopened (src/broker/inbox.{h,cc}); of Actor (src/executor) the turn, the next
 *          message, serving early, control causes, suspend, resume, what is dropped while it is
 *          suspended, and the alarm of a restart; Executor::enqueue, run_ready, run_early
 *          (src/executor/executor.cc).
 * Leaves out  lanes: what waits is a count behind the lane's bit (inbox.pml has the lanes).
 *          Sleeping, and arming timers: a worker sees a ready component at once (eventcount.pml).
 *          Time: a timer that is due may be so before or after the message that waits, an alarm at
 *          any time after it was set. A turn ends early after TURN activations.
 * Checks   two workers never serve one component at once; no turn has more than TURN activations,
 *          control causes included; when all is still, every message, tick and control cause was
 *          served: none is left behind in a component that is not queued, although it takes
 *          messages only once a control cause has opened it. ORDERED, EARLY: a message is served
 *          after each control cause that was posted before it was pushed.
 *          With SUSPENDING: what was there when it was asked to resume is dropped and not served,
 *          except for the LATCHED newest, which are served. With FAULT: a component whose callback
 *          throws is made anew when its alarm is due.
 *
 * A control thread posts CONTROLS causes; the OPENING first of them open the component, the one
 * with the number SUSPENDING suspends it, the one with the number RESUMING resumes it. Of the
 * first REPOSTS each posts another one, as a call that is repeated in its refusal does. The
 * message FAULT throws: the component is suspended, and an alarm is set.
 * EARLY: the only worker also takes messages before they were marked, while it waits for the
 * component to be queued. It does not once all others have ended: what is left then, their marks
 * must bring.
 *
 * run short: two workers, messages and a tick        -DMESSAGES=2 -DTICKS=1
 * run short: two publishers                          -DMESSAGES=1 -DPUBLISHERS=2
 * run short: three causes                            -DCONTROLS=3 -DMESSAGES=1
 * run short: causes that post causes                 -DREPOSTS=3 -DMESSAGES=1 -DTURN=2 -DOPENING=1
 * run short: early                                   -DWORKERS=1 -DEARLY -DMESSAGES=1 -DTICKS=1
 * run short: early, causes while it is open          -DWORKERS=1 -DEARLY -DMESSAGES=2 -DCONTROLS=3 -DOPENING=1
 * run short: the order of causes and messages        -DORDERED -DMESSAGES=1 -DCONTROLS=2 -DOPENING=1 -DTURN=2
 * run short: suspended and resumed                   -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=1
 * run short: suspended and resumed, latched          -DWORKERS=1 -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2 -DLATCHED=1
 * run short: suspended for good                      -DCONTROLS=2 -DOPENING=1 -DSUSPENDING=2 -DMESSAGES=1
 * run short: suspended and resumed, early            -DWORKERS=1 -DEARLY -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2
 * run short: a fault and a restart                   -DCONTROLS=1 -DFAULT=0 -DMESSAGES=2
 * run short: a fault and a restart, early            -DWORKERS=1 -DEARLY -DCONTROLS=1 -DFAULT=0 -DMESSAGES=2
 * run long: order, two publishers                    -DORDERED -DMESSAGES=1 -DPUBLISHERS=2 -DCONTROLS=3 -DOPENING=1
 * run long: order, a tick                            -DORDERED -DMESSAGES=2 -DTICKS=1 -DOPENING=1
 * run long: early, two publishers                    -DWORKERS=1 -DEARLY -DMESSAGES=1 -DPUBLISHERS=2 -DCONTROLS=3 -DOPENING=1
 * run long: early, two components                    -DWORKERS=1 -DEARLY -DCOMPONENTS=2 -DMESSAGES=1 -DCONTROLS=1
 * run long: early, turns of two                      -DWORKERS=1 -DEARLY -DTURN=2 -DMESSAGES=3 -DTICKS=1 -DOPENING=1
 * run long: three workers                            -DWORKERS=3 -DMESSAGES=2 -DTICKS=1
 * run long: two publishers, two ticks                -DMESSAGES=2 -DPUBLISHERS=2 -DTICKS=2
 * run long: two components                           -DCOMPONENTS=2 -DMESSAGES=1 -DTICKS=1
 * run long: turns of two                             -DTURN=2 -DMESSAGES=3 -DTICKS=1 -DPUBLISHERS=2
 * run long: suspended for good, with ticks            -DCONTROLS=2 -DOPENING=1 -DSUSPENDING=2 -DMESSAGES=2 -DTICKS=1
 * run long: suspended and resumed, two messages       -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2
 * run long: suspended and resumed, latched, two workers  -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2 -DLATCHED=1
 * run long: a fault and a restart, early, a tick      -DWORKERS=1 -DEARLY -DCONTROLS=1 -DFAULT=0 -DMESSAGES=2 -DTICKS=1
 * run long: suspended and resumed, with ticks        -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=3 -DTICKS=1 -DTURN=2
 * run long: suspended and resumed, early, latched    -DWORKERS=1 -DEARLY -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=3 -DTICKS=1 -DLATCHED=1
 * run long: a fault while it is suspended and resumed  -DWORKERS=1 -DEARLY -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=3 -DFAULT=0
 * bug BUG_NO_GATE: a worker does not heed that another serves the component  -DMESSAGES=2 -DTICKS=1
 * bug BUG_CONTROL_AS_MARK: a control cause queues only a quiet component     -DMESSAGES=1
 * bug BUG_EARLY_END_FORGETS: a turn that ends early does not queue again     -DMESSAGES=2
 * bug BUG_UNOPENED_END_BLIND: an unopened turn ends without a look at the control bit  -DMESSAGES=1
 * bug BUG_IDLE_END_BLIND: an idle turn ends without comparing the word       -DMESSAGES=1
 * bug BUG_BIT_TAKEN_LATE: the causes are taken before their bit is           -DMESSAGES=1
 * bug BUG_TICK_TAKEN_LATE: the timer's bit is taken after the timers were looked at  -DTICKS=2
 * bug BUG_TURN_BEFORE_CONTROLS: a turn does not look whether causes came before a message  -DORDERED -DMESSAGES=1 -DOPENING=1 -DTURN=2
 * bug BUG_CONTROLS_UNCOUNTED: control causes do not count for the length of a turn  -DREPOSTS=3 -DMESSAGES=1 -DTURN=2 -DOPENING=1
 * bug BUG_CONTROLS_LEFT: a turn that leaves control causes behind does not set their bit again  -DCONTROLS=3 -DMESSAGES=1
 * bug BUG_EARLY_SHARED: two workers serve early                              -DEARLY -DMESSAGES=2 -DOPENING=1
 * bug BUG_EARLY_UNOPENED: a component is served early that is not open       -DWORKERS=1 -DEARLY -DMESSAGES=1
 * bug BUG_EARLY_BEFORE_CONTROLS: no look whether control causes wait         -DWORKERS=1 -DEARLY -DMESSAGES=1 -DOPENING=1
 * bug BUG_EARLY_CONTROLS_FIRST: that look goes before the look at the lane   -DWORKERS=1 -DEARLY -DMESSAGES=1 -DOPENING=1
 * bug BUG_CONTROLS_CLEARED_LATE: that none waits is said after they have run  -DWORKERS=1 -DEARLY -DMESSAGES=1 -DCONTROLS=3 -DOPENING=1
 * bug BUG_CONTROLS_SET_LATE: that one waits is said after it was posted      -DWORKERS=1 -DEARLY -DMESSAGES=1 -DOPENING=1
 * bug BUG_EARLY_CLEARS: who serves a message early clears the lane's bit     -DWORKERS=1 -DEARLY -DMESSAGES=2 -DOPENING=1
 * bug BUG_SUSPEND_UNQUEUED: who is suspended early is marked, but not queued  -DWORKERS=1 -DEARLY -DCONTROLS=1 -DFAULT=0 -DMESSAGES=2
 * bug BUG_DROP_BY_TAIL: what waits is told by the tail, which is seen late   -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2
 * bug BUG_DROP_BY_TAIL: the same, with latched messages                      -DWORKERS=1 -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=3 -DLATCHED=1
 * bug BUG_RESUME_KEEPS: what came while it was suspended is not dropped when it resumes  -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2
 * bug BUG_RESUME_UNMARKED: latched messages get no bit when it resumes       -DCONTROLS=3 -DOPENING=1 -DSUSPENDING=2 -DRESUMING=3 -DMESSAGES=2 -DLATCHED=1
 * bug BUG_SUSPENDED_END_BLIND: a suspended turn ends as an unopened one      -DCONTROLS=2 -DOPENING=1 -DSUSPENDING=2 -DMESSAGES=2
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
#ifndef REPOSTS
#define REPOSTS 0
#endif
#ifndef LATCHED
#define LATCHED 0
#endif
#ifndef SUSPENDING
#define SUSPENDING 99
#endif
#ifndef RESUMING
#define RESUMING 99
#endif
#if SUSPENDING != 99 || defined(FAULT)
#define SUSPENDS
#endif

#define FLAG(i) (1 << (i))
#define LANE 1
#define TIMER 2
#define CONTROL 4
#define RUNNING 8

#define CLOSED 0
#define OPEN 1
#define SUSPENDED 2

byte ready = 0;         /* Executor::ready_ */
byte state[COMPONENTS]; /* Inbox::state_ */
byte gate[COMPONENTS];
bool has_controls[COMPONENTS];
byte messages[COMPONENTS], ticks[COMPONENTS], controls[COMPONENTS]; /* what waits */

/* What is observed. */
byte serving[COMPONENTS], controls_served[COMPONENTS];
byte writers_ended = 0;
#define WRITERS (COMPONENTS * (PUBLISHERS + 2))
#ifdef SUSPENDS
/* The alarm is set, its time is told to the timers, and that is over. */
bool alarm[COMPONENTS], armed[COMPONENTS], due[COMPONENTS];
byte settled[COMPONENTS]; /* messages whose `publish` has returned */
byte stale[COMPONENTS];   /* of these, who were there when it was asked to resume */
bool is_resumed[COMPONENTS];
#endif
#if defined(EARLY) || defined(ORDERED) || defined(SUSPENDS)
byte pushed[COMPONENTS], popped[COMPONENTS];
#endif
#ifdef BUG_DROP_BY_TAIL
byte tails[COMPONENTS]; /* what was pushed, as far as the tail tells */
#endif
#if defined(EARLY) || defined(ORDERED)
#define CHECKS_ORDER
byte posted[COMPONENTS]; /* control causes whose `post` has returned */
byte posted_before[COMPONENTS * MESSAGES * PUBLISHERS]; /* that each message was pushed */
#define NR(component, message) ((component) * MESSAGES * PUBLISHERS + (message))
#define note_push(component) \
  posted_before[NR(component, pushed[component])] = posted[component]; pushed[component]++
#define note_pop(component) popped[component]++
#define note_post(component) posted[component]++
#else
#ifdef SUSPENDS
#define note_push(component) pushed[component]++
#define note_pop(component) popped[component]++
#else
#define note_push(component) skip
#define note_pop(component) skip
#endif
#define note_post(component)
#endif

#define pop(component) messages[component]--; note_pop(component)

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


#ifdef SUSPENDS
/* Whoever calls this may hold the running bit, or serve early without it. */
inline suspend(component) {
  gate[component] = SUSPENDED;
  ticks[component] = 0;
#ifdef BUG_SUSPEND_UNQUEUED
  state[component] = state[component] | LANE
#else
  mark(component, LANE)
#endif
}

#ifdef BUG_DROP_BY_TAIL
#define waits_beyond(component, kept) \
  (messages[component] > 0 && tails[component] > popped[component] + kept)
#else
#define waits_beyond(component, kept) (messages[component] > kept)
#endif

inline drop_inactive(component) {
  atomic { is_taken = (state[component] & LANE) != 0; state[component] = state[component] & ~LANE }
  if
  :: is_taken ->
     do
     :: waits_beyond(component, LATCHED) -> pop(component)
     :: else -> break
     od
  :: else
  fi;
  is_taken = false
}

inline resume(component) {
#ifndef BUG_RESUME_KEEPS
  drop_inactive(component);
#endif
  alarm[component] = false;
  gate[component] = OPEN;
#ifndef BUG_RESUME_UNMARKED
  state[component] = state[component] | LANE;
#endif
  mark(component, TIMER)
}

/* With a time that is over the alarm must be served, with one that may be it can be. */
inline publish_due(component) {
  if
  :: alarm[component] && !due[component] -> armed[component] = true
  :: else
  fi
}
#else
#define publish_due(component) skip
#endif

inline run_control(component) {
  if
  :: controls_served[component] == OPENING -> gate[component] = OPEN
#ifdef SUSPENDS
  :: controls_served[component] == SUSPENDING && gate[component] == OPEN -> suspend(component)
  :: controls_served[component] == RESUMING && gate[component] == SUSPENDED ->
     resume(component);
     is_resumed[component] = true
#endif
  :: else
  fi;
  if
  :: controls_served[component] <= REPOSTS ->
     atomic { controls[component]++; has_controls[component] = true }
     mark_control(component)
  :: else
  fi
}

/* As many as the turn has room for; what is left keeps its bit. */
inline run_controls(component) {
  do
#ifdef BUG_CONTROLS_UNCOUNTED
  :: controls[component] > 0 ->
#else
  :: controls[component] > 0 && count < TURN ->
#endif
     atomic {
       controls[component]--;
       controls_served[component]++;
#ifndef BUG_CONTROLS_CLEARED_LATE
       has_controls[component] = controls[component] > 0;
#endif
       count++
     }
     run_control(component);
#ifdef BUG_CONTROLS_CLEARED_LATE
     if
     :: controls[component] == 0 -> has_controls[component] = false
     :: else
     fi
#endif
  :: else -> break
  od;
#ifndef BUG_CONTROLS_LEFT
  if
  :: controls[component] > 0 -> state[component] = state[component] | CONTROL
  :: else
  fi
#endif
}

#ifdef CHECKS_ORDER
#define check_order(component) \
  assert(controls_served[component] >= posted_before[NR(component, popped[component])])
#else
#define check_order(component) skip
#endif

#ifdef SUSPENDS
#define check_fresh(component) \
  assert(!is_resumed[component] || popped[component] + LATCHED >= stale[component])
#else
#define check_fresh(component) skip
#endif
#ifdef FAULT
#define throws(component) (popped[component] == FAULT + 1)
#else
#define throws(component) false
#endif

/* The callback of a message. */
inline take(component) {
  atomic { check_order(component); check_fresh(component); pop(component) }
#ifdef FAULT
  if
  :: throws(component) -> alarm[component] = true; due[component] = false; suspend(component)
  :: else
  fi
#endif
}

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
     :: has_message && has_controls[component] ->
        has_message = false; run_controls(component);
        if
        :: gate[component] != OPEN || count >= TURN -> has_stopped = true; break
        :: else
        fi
     :: else -> break
#endif
     fi
  od;
  if
  :: has_stopped
  :: !has_stopped && ticks[component] > 0 ->
     ticks[component] = 0; has_run = true /* what is late replaces the ticks that it missed */
  :: !has_stopped && has_message -> take(component); has_run = true
  :: !has_stopped && ticks[component] == 0 && !has_message
  fi;
  has_message = false
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
  may_run = may_run && gate[component] == OPEN;
#endif
#if !defined(BUG_EARLY_BEFORE_CONTROLS) && !defined(BUG_EARLY_CONTROLS_FIRST)
  may_run = may_run && !has_controls[component];
#endif
  may_run = may_run && ticks[component] == 0;
  if
  :: may_run ->
     atomic { serving[component]++; assert(serving[component] == 1 && gate[component] == OPEN) }
     take(component);
     publish_due(component);
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
  bool is_taken, has_run, has_message, has_stopped, may_run;

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
        assert(count <= TURN);
        if
        :: count == TURN ->
           publish_due(c);
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
#ifdef SUSPENDS
        if
        :: gate[c] == SUSPENDED ->
           take_bit(c, TIMER);
           ticks[c] = 0;
           drop_inactive(c);
           if
           :: alarm[c] -> due[c] = false; resume(c); count++; goto again
           :: !alarm[c] || !due[c]
           fi;
           publish_due(c);
#ifndef BUG_SUSPENDED_END_BLIND
           atomic {
             if
             :: state[c] == RUNNING -> state[c] = 0; serving[c]--; goto next_one
             :: else -> goto again
             fi
           }
#endif
        :: else
        fi;
#endif
        if
        :: gate[c] != OPEN ->
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
#ifndef BUG_TICK_TAKEN_LATE
        take_bit(c, TIMER);
#endif
        run_next(c);
#ifdef BUG_TICK_TAKEN_LATE
        take_bit(c, TIMER);
#endif
        if
        :: has_run -> has_run = false; count++; goto again
        :: has_stopped -> has_stopped = false; goto again
        :: else
        fi;
        publish_due(c);
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
#ifdef SUSPENDS
     settled[c]++;
#endif
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
#ifdef SUSPENDS
     if
     :: i + 1 == RESUMING -> stale[c] = settled[c]
     :: else
     fi;
#endif
     atomic { controls[c]++; has_controls[c] = true }
     mark_control(c);
     note_post(c);
#endif
     i++
  :: else -> break
  od;
  writers_ended++
}

#ifdef SUSPENDS
/* Executor::fire_timers, for the alarm. */
proctype Alarm(byte c) {
  byte was;
end_waiting:
  do
  :: atomic { armed[c] -> armed[c] = false; due[c] = alarm[c] }
     mark(c, TIMER)
  od
}
#endif

#ifdef BUG_DROP_BY_TAIL
proctype Tail(byte c) {
end_seen:
  do
  :: tails[c] < pushed[c] -> tails[c]++
  od
}
#endif

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
#ifdef SUSPENDS
       run Alarm(c);
#endif
#ifdef BUG_DROP_BY_TAIL
       run Tail(c);
#endif
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
#ifdef SUSPENDS
       assert(!alarm[c]);
       assert(gate[c] == (RESUMING == 99 && SUSPENDING != 99 -> SUSPENDED : OPEN));
       assert(messages[c] <= (gate[c] == SUSPENDED -> LATCHED : 0));
#else
       assert(messages[c] == 0);
#endif
       assert(ticks[c] == 0);
       assert(controls[c] == 0 && controls_served[c] == CONTROLS + REPOSTS);
       c++
    :: else -> break
    od
  }
}
