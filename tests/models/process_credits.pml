/*
 * Credits between processes: a publisher waits until receivers in another process have finished.
 *
 * Mirrors  Credits::await, settle, take_foreign, has_foreign, take_returned (src/broker/credits.{h,cc});
 *          Export::unfinished; Import::take, tell_finished; LinkSet::take, announce, has_any
 *          (src/segment); the workers' sleep of process_bell.pml.
 * Leaves out  the queue between the processes (remote_lane.pml): a message that was sent arrives. The
 *          wake-up of a worker of the same process: it sees a component that is ready. Restarts of
 *          either process: after one nothing is in transit.
 * Checks   when all is still, everything was published (no lost wake-up). There are never more messages
 *          in transit to a lane than the window has.
 *
 * LANES of the receiving process have a worker each. ENDS: the last one ends at any time, and then
 * counts no more. THREAD: the publisher is a thread that waits for credits (credits.pml), beside workers
 * that only take them.
 *
 * run short: one lane                        -DMESSAGES=3
 * run short: two lanes                       -DMESSAGES=2 -DLANES=2
 * run short: one lane, window of two         -DMESSAGES=3 -DWINDOW=2
 * run short: two workers of the publisher    -DMESSAGES=2 -DWORKERS=2
 * run short: two lanes, one ends             -DMESSAGES=2 -DLANES=2 -DENDS
 * run short: a thread                        -DMESSAGES=3 -DTHREAD
 * run short: a thread, two lanes             -DMESSAGES=2 -DLANES=2 -DTHREAD
 * run long: two lanes, window of two         -DMESSAGES=4 -DLANES=2 -DWINDOW=2
 * run long: all of it                        -DMESSAGES=3 -DLANES=2 -DWINDOW=2 -DWORKERS=2 -DENDS
 * run long: a thread, all of it              -DMESSAGES=3 -DLANES=2 -DWINDOW=2 -DWORKERS=2 -DENDS -DTHREAD
 * bug BUG_NO_SECOND_LOOK: who says that it waits does not count again                 -DMESSAGES=2 -DTHREAD
 * bug BUG_AWAITS_FIRST: the receiver reads whether it is awaited, then counts         -DMESSAGES=2
 * bug BUG_BELL_READ_LATE: a worker reads the bell after it looked for credits         -DMESSAGES=2
 * bug BUG_SILENT_BELL: the receiver wakes without a new value of the bell             -DMESSAGES=2
 * bug BUG_NO_LOCK: two lanes tell their counts without a lock                         -DMESSAGES=2 -DLANES=2
 * bug BUG_POSITION_FIRST: a message counts as passed on before it is in the lanes     -DMESSAGES=4 -DWINDOW=2
 * bug BUG_FLAG_LATE: the word is cleared after the publisher may wait again           -DMESSAGES=3 -DWORKERS=2
 */
#ifndef LANES
#define LANES 1
#endif
#ifndef WINDOW
#define WINDOW 1
#endif
#ifndef WORKERS
#define WORKERS 1
#endif

/* Words in the publisher's segment. */
byte tail = 0;
bool awaits = false;  /* LinkOut::awaits_credit */
/* And in the receiver's. */
byte told = 0;        /* LinkIn::finished, + WINDOW */
byte bell = 0;

/* The publisher's process. */
bool is_awaiting = false, is_returned = false, is_awaited = false;
byte awaited = 0, sent = 0;
bool is_ready = true, is_running = false; /* its component */
byte sleepers = 0;
bool is_asleep[WORKERS];

/* The receiver's. */
bool lock = false;
byte head = 0, passed_on = 0;
byte pushed[LANES], finished[LANES];
bool is_over[LANES];

byte lane_at; /* of the check */

#define left (tail + WINDOW - told >= WINDOW -> 0 : WINDOW - (tail + WINDOW - told))

inline lane_returned() {
  atomic { awaited--; is_last = awaited == 0 }
  if
  :: is_last -> is_returned = true; is_ready = true
  :: else
  fi;
  is_last = false
}

inline settle() {
  atomic { was = is_awaited; is_awaited = false }
  if
  :: was ->
#ifndef BUG_FLAG_LATE
     awaits = false;
#endif
     lane_returned()
#ifdef BUG_FLAG_LATE
     ;
     awaits = false
#endif
  :: else
  fi;
  was = false
}

inline await() {
  if
  :: !is_awaiting ->
     is_awaiting = true;
     awaited = 1;
     if
     :: left == 0 ->
        awaited++;
        awaits = true;
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

/* Publishes as far as there are credits, then waits for more. */
inline publish() {
  if
  :: is_returned -> is_returned = false; is_awaiting = false
  :: else
  fi;
  do
  :: sent < MESSAGES && left > 0 ->
     atomic {
       tail++;
       sent++;
       lane_at = 0;
       do
       :: lane_at < LANES ->
          assert(is_over[lane_at] || tail - finished[lane_at] <= WINDOW);
          lane_at++
       :: else -> break
       od;
       lane_at = 0
     }
  :: else -> break
  od;
  if
  :: sent < MESSAGES -> await()
  :: else
  fi
}

#ifdef THREAD
#define has_work false
proctype Thread() {
  bool was, is_last;
  do
  :: sent == MESSAGES -> break
  :: else -> atomic { is_ready -> is_ready = false }
     publish()
  od
}
#else
#define has_work (is_ready && !is_running)
#endif

proctype Worker(byte self) {
  byte seen;
  bool was, is_last;
  do
  :: sent == MESSAGES && !is_running -> break
  :: else ->
     /* LinkSet::take */
     if
     :: is_awaited && left > 0 -> settle()
     :: else
     fi;
     if
#ifndef THREAD
     :: atomic { has_work -> is_ready = false; is_running = true }
        publish();
        is_running = false
#endif
     :: else ->
        atomic { sleepers++ }
#ifndef BUG_BELL_READ_LATE
        seen = bell;
#endif
        if
        :: is_awaited && left > 0
        :: else ->
#ifdef BUG_BELL_READ_LATE
           seen = bell;
#endif
           atomic { is_asleep[self] = bell == seen } /* futex_waitv */
           !is_asleep[self] || has_work || (sent == MESSAGES && !is_running);
           is_asleep[self] = false
        fi;
        atomic { sleepers--; seen = 0 }
     fi
  od
}

/* Import::tell_finished. */
inline tell_finished() {
#ifndef BUG_NO_LOCK
  atomic { !lock -> lock = true }
#endif
#ifdef BUG_AWAITS_FIRST
  is_wanted = awaits;
#endif
  most = 0;
  lane = 0;
  do
  :: lane < LANES ->
     if
     :: !is_over[lane] && pushed[lane] - finished[lane] > most ->
        most = pushed[lane] - finished[lane]
     :: else
     fi;
     lane++
  :: else -> break
  od;
  told = passed_on + WINDOW - most;
#ifndef BUG_AWAITS_FIRST
  is_wanted = awaits;
#endif
  if
  :: is_wanted ->
#ifndef BUG_SILENT_BELL
     bell++;
#endif
     if
     :: sleepers > 0 ->
        atomic {
          if
          :: is_asleep[0] -> is_asleep[0] = false
#if WORKERS > 1
          :: is_asleep[1] -> is_asleep[1] = false
#endif
          :: else
          fi
        }
     :: else
     fi
  :: else
  fi;
  atomic { is_wanted = false; most = 0; lane = 0 }
#ifndef BUG_NO_LOCK
  lock = false
#endif
}

/* Import::take, which puts each message into the lanes. */
proctype Importer() {
  byte lane, most;
  bool is_wanted;
end_importing:
  do
  :: head < tail ->
     head++;
#ifdef BUG_POSITION_FIRST
     passed_on = head;
#endif
     atomic { !lock -> lock = true }
     lane = 0;
     do
     :: lane < LANES -> pushed[lane]++; lane++
     :: else -> break
     od;
     lock = false;
#ifndef BUG_POSITION_FIRST
     atomic { !lock -> passed_on = head }
#endif
     tell_finished()
  od
}

proctype Receiver(byte self) {
  byte lane, most;
  bool is_wanted;
end_receiving:
  do
  :: pushed[self] > finished[self] && !is_over[self] ->
     finished[self]++;
     tell_finished()
#ifdef ENDS
  :: self == LANES - 1 && !is_over[self] ->
     is_over[self] = true;
     tell_finished()
#endif
  od
}

init {
  byte i;
  atomic {
    told = WINDOW;
    do
    :: i < WORKERS -> run Worker(i); i++
    :: else -> break
    od;
    i = 0;
    do
    :: i < LANES -> run Receiver(i); i++
    :: else -> break
    od;
    run Importer();
#ifdef THREAD
    run Thread();
#endif
    i = 0
  }
  timeout -> assert(sent == MESSAGES)
}
