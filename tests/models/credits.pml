/*
 * Threads that wait for credits: who gives a credit back, who stops, and who mutes them.
 *
 * Mirrors  Credits::await, take_returned, lane_returned, left_of, wake; LaneCredit::finish, end,
 *          settle (src/broker/credits.{h,cc}); PublisherCore::wait_for_credit,
 *          set_external_muted (src/broker/publisher_core.cc).
 * Leaves out  the lane itself: what is on its way is a count. What components do instead of
 *          waiting: they are marked where `wake` is (actor_state.pml has the marking).
 *          Publishing takes place while the lock is still held; really other threads may be faster.
 * Checks   when all is still, every thread has published all, or has seen that it was stopped:
 *          none waits beside a credit or a stop. There are never more messages on their way than
 *          the window has.
 *
 * STOPS: they are stopped at any time. MUTES: they are muted and heard again. ENDS: the receiver
 * ends at any time, and what it had counts no more. STUCK: it does not come back from its callback.
 *
 * run short: one thread                       -DMESSAGES=3
 * run short: one thread, stopped              -DMESSAGES=2 -DSTOPS
 * run short: stopped beside a receiver that is stuck  -DMESSAGES=2 -DSTOPS -DSTUCK
 * run short: one thread, muted and stopped    -DMESSAGES=2 -DMUTES -DSTOPS
 * run short: the receiver ends                -DMESSAGES=3 -DENDS
 * run long: two threads                       -DMESSAGES=2 -DTHREADS=2 -DWINDOW=2
 * run long: two threads, all of it            -DMESSAGES=2 -DTHREADS=2 -DSTOPS -DMUTES -DENDS
 * bug BUG_STOP_BEFORE_EPOCH: the stop is looked at before the epoch is read   -DMESSAGES=2 -DSTOPS -DSTUCK
 * bug BUG_EPOCH_LATE: the epoch is read after the credits were counted        -DMESSAGES=2
 * bug BUG_NO_SECOND_LOOK: who says that it waits does not count again         -DMESSAGES=2
 * bug BUG_AWAITED_FIRST: the receiver looks whether it is awaited, then counts  -DMESSAGES=2
 * bug BUG_MUTE_UNTOLD: nobody is woken when they are heard again              -DMESSAGES=2 -DMUTES
 * bug BUG_END_UNTOLD: nobody is woken when the receiver ends                  -DMESSAGES=2 -DENDS
 */
#ifndef MESSAGES
#define MESSAGES 1
#endif
#ifndef THREADS
#define THREADS 1
#endif
#ifndef WINDOW
#define WINDOW 1
#endif

bool lock = false;     /* PublisherCore::mutex_ */
byte passed_on = 0;    /* Lane::passed_on */
byte finished = 0;     /* LaneCredit */
bool is_over = false, is_awaited = false;
bool is_awaiting = false, is_returned = false; /* Credits */
byte awaited = 0, epoch = 0;
bool is_stopped = false, is_muted = false;

byte ended = 0; /* observed */

#define left (is_over -> WINDOW : WINDOW - (passed_on - finished))

inline lane_returned() {
  atomic { awaited--; is_last = awaited == 0 }
  if
  :: is_last -> is_returned = true; epoch++ /* and those who wait are woken */
  :: else
  fi;
  is_last = false
}

inline settle() {
  if
  :: is_awaited ->
     atomic { was = is_awaited; is_awaited = false }
     if
     :: was -> lane_returned()
     :: else
     fi;
     was = false
  :: else
  fi
}

inline await() {
  if
  :: !is_awaiting ->
     is_awaiting = true;
     awaited = 1;
     if
     :: left == 0 ->
        awaited++;
        is_awaited = true;
#ifndef BUG_NO_SECOND_LOOK
        if
        :: left > 0 -> settle()
        :: else
        fi
#endif
     :: else
     fi;
     lane_returned()
  :: else
  fi
}

proctype Thread() {
  byte known, sent;
  bool was, is_last;
  do
  :: sent == MESSAGES -> break
  :: else ->
#ifdef BUG_STOP_BEFORE_EPOCH
     if
     :: is_stopped -> break
     :: else
     fi;
     known = epoch;
#else
     known = epoch;
     if
     :: is_stopped -> break
     :: else
     fi;
#endif
     atomic { !lock -> lock = true }
     if
     :: is_returned -> is_returned = false; is_awaiting = false
     :: else
     fi;
     if
     :: is_muted
     :: !is_muted && left > 0 ->
        atomic {
          passed_on++;
          assert(is_over || passed_on - finished <= WINDOW);
          sent++;
          lock = false
        }
        goto next_one
     :: else -> await()
     fi;
     lock = false;
#ifdef BUG_EPOCH_LATE
     known = epoch;
#endif
     epoch != known; /* Credits::wait_beyond */
next_one:
     known = 0
  od;
  ended++
}

proctype Receiver() {
  bool was, is_last;
end_receiving:
  do
  :: passed_on > finished && !is_over ->
#ifdef BUG_AWAITED_FIRST
     was = is_awaited;
     finished++;
     if
     :: was -> was = false; settle()
     :: else
     fi
#else
     finished++;
     settle()
#endif
#ifdef ENDS
  :: !is_over ->
     is_over = true;
#ifndef BUG_END_UNTOLD
     settle()
#endif
#endif
  od
}

proctype Stopper() {
  is_stopped = true;
  epoch++ /* by the stop callback, which runs after the mark */
}

proctype Muter() {
  atomic { !lock -> lock = true; is_muted = true }
  epoch++;
  lock = false;
  atomic { !lock -> lock = true; is_muted = false }
#ifndef BUG_MUTE_UNTOLD
  epoch++;
#endif
  lock = false
}

init {
  byte i;
  atomic {
    do
    :: i < THREADS -> run Thread(); i++
    :: else -> break
    od;
#ifndef STUCK
    run Receiver();
#endif
#ifdef STOPS
    run Stopper();
#endif
#ifdef MUTES
    run Muter();
#endif
    i = 0
  }
  timeout -> assert(ended == THREADS)
}
