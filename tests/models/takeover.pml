/*
 * A process on standby that takes the place of the one that it follows.
 *
 * Mirrors  the ring of activations and its reading (ActivationRing, Follower::read_rings), executing what the other
 *          process executed once its input came here too (FollowedComponent), taking over (Follower::take_over,
 *          PublisherCore::stop_following and send_following), the end of workers that the kernel tells of and of
 *          the process that the supervisor tells of (Pair::has_ended), and sleeping on all that (Pair::ring, announce).
 * Leaves out  overwriting in the ring (activation_ring.pml), several receivers and those in the process on
 *          standby (duplicates.pml), the bell of links (process_bell.pml: here what is pushed wakes), the workers of the
 *          process on standby beyond one (eventcount.pml), crashes that are left out, the restart of a process.
 * Checks   nothing of the first process is published once the second one publishes, nor accepted after it; each
 *          input leads to one output, all are accepted in the order in which they were made, and each is what the
 *          first process made of the same inputs; nobody waits for ever: when all is still, all inputs led to
 *          outputs, and as long as both live the second one has executed all that the first one did.
 *
 * A component of the first process is served by one of WORKERS workers at a time. It has inputs of two kinds, X and Y, and
 * chooses among those that are there; its state is the row of its choices, and that is what it publishes. The kinds have
 * publishers of their own, which push to the first process and to the second one in this order or in the other.
 *
 * The first process may be killed at any step; its workers end one after the other, and go on as long as they did not. Before,
 * a worker may stand still for good (STANDS): the supervisor ends who gives no sign of life. It does so also to one that is only
 * slow. Told is the end of each worker, which wakes one sleeper, and after that the end of the process.
 *
 * run long: one worker, two inputs               -DX=1 -DY=1
 * run short: the process on standby is given everything first  -DX=1 -DY=1 -DSTANDBY_FIRST
 * run short: two workers, one input               -DWORKERS=2 -DX=1 -DY=0
 * run short: two workers that may stand still     -DWORKERS=2 -DX=1 -DY=0 -DSTANDS
 * run long: one worker that may stand still       -DX=1 -DY=1 -DSTANDS
 * run long: one worker, three inputs              -DX=2 -DY=1
 * run long: two workers, two inputs               -DWORKERS=2 -DX=1 -DY=1
 * run long: two workers that may stand still, two inputs  -DWORKERS=2 -DX=1 -DY=1 -DSTANDS
 * run long: two workers, three inputs, the process on standby is given them first  -DWORKERS=2 -DX=2 -DY=1 -DSTANDBY_FIRST
 * bug BUG_FIRST_WORKER: it takes over when the first worker has ended, not all              -DWORKERS=2 -DX=1 -DY=0
 * bug BUG_NOT_FENCED: who gives no sign of life is said to have ended, and is not ended     -DX=1 -DY=1 -DSTANDS
 * bug BUG_NO_LIMIT: nobody ends a process that stands still                                 -DX=1 -DY=1 -DSTANDS
 * bug BUG_READ_BEFORE_THE_END: the rings are not read again once the end was seen  -DX=2 -DY=1 -DSTANDBY_FIRST
 * bug BUG_NOT_DRAINED: what the first one left in its link is not taken before it publishes -DX=1 -DY=1
 * bug BUG_BEGUN_LEFT_OUT: what was begun and not ended is not executed                      -DX=1 -DY=1
 * bug BUG_ENDED_ONLY: of each ring it reads what has ended, and goes on from its end        -DX=1 -DY=1
 * bug BUG_BEGUN_LATE: the first one says that it begins after it has published              -DX=1 -DY=1
 * bug BUG_ENDED_EARLY: it says that it has ended before it has published                    -DX=1 -DY=1
 * bug BUG_MUTED_TO_THE_END: what is left to execute is muted, as the rest                   -DX=1 -DY=1
 * bug BUG_INPUT_NOT_AWAITED: whatever input is there is taken, if that of the ring is not   -DX=1 -DY=1
 * bug BUG_NOBODY_WOKEN: progress is counted up, and nobody woken                            -DX=1 -DY=1
 * bug BUG_LOOKS_FIRST: it looks for news, then announces that it sleeps                     -DX=1 -DY=1
 * bug BUG_SLEEPERS_READ_FIRST: the first one looks for sleepers, then counts up             -DX=1 -DY=1
 * bug BUG_PROGRESS_READ_LATE: which progress was seen is noted after the rings were read    -DX=1 -DY=1
 * bug BUG_END_NOT_WATCHED: it sleeps on progress, and on the end of nobody                  -DX=1 -DY=1
 */
#ifndef WORKERS
#define WORKERS 1
#endif
#define INPUTS (X + Y)
#define ALL_ENDED ((1 << WORKERS) - 1)
#define RECORD(worker, place) ((worker) * INPUTS + (place))
#define RUNS 0
#define DONE 1

/* Links of inputs, by kind: how many came to the first process and to the second. */
byte came_first[2], came_second[2];

/* The first process: what its component took, chose and made. */
byte taken[2], state = 0, number = 0;
bool is_running = false;

/* Its shared memory. */
byte begun[WORKERS];                /* of the ring: records in it */
byte number_of[WORKERS * INPUTS], kind_of[WORKERS * INPUTS];
bit outcome[WORKERS * INPUTS];
byte progress = 0;
byte given = 0;                     /* its link to the second process: sequences */

byte life = 0;                      /* the kernel's: workers that have ended, as bits */
bool is_announced = true;           /* the supervisor's */
bool dies[WORKERS], stands[WORKERS];

/* The second process. */
byte sleepers = 0;
bool is_asleep = false;
byte executed = 0;
bool is_public = false, is_over = false;

/* The links to the receiver: sequence and content. */
chan from_first = [INPUTS] of { byte, byte };
chan from_second = [INPUTS] of { byte, byte };

/* What is observed. */
byte history[INPUTS + 1];
byte last = 0, content = 0;
bool has_second = false;

proctype Source(byte kind) {
  byte i;
  do
  :: i < (kind == 0 -> X : Y) ->
#ifdef STANDBY_FIRST
     d_step { came_second[kind]++; is_asleep = false }
     came_first[kind]++;
#else
     came_first[kind]++;
     d_step { came_second[kind]++; is_asleep = false }
#endif
     i++
  :: else -> break
  od
}

#define IS_THERE(kind) (came_first[kind] > taken[kind])

inline begin() {
  d_step {
    number_of[RECORD(self, begun[self])] = number;
    kind_of[RECORD(self, begun[self])] = kind;
    begun[self]++
  }
}

inline end() {
  outcome[RECORD(self, begun[self] - 1)] = DONE
}

proctype First(byte self) {
  byte kind;
  {
end_waiting:
    do
    :: atomic {
         !is_running && (IS_THERE(0) || IS_THERE(1)) ->
         is_running = true;
         if
         :: IS_THERE(0) -> kind = 0
         :: IS_THERE(1) -> kind = 1
         fi;
         taken[kind]++
       }
       d_step { /* of its own memory */
         number++;
         state = 3 * state + kind + 1;
         history[number] = state
       }
#ifndef BUG_BEGUN_LATE
       begin();
#endif
#ifdef BUG_ENDED_EARLY
       end();
#endif
       /* To the second process, and to the receiver. */
       d_step { assert(!is_public); given = number; is_asleep = false }
       d_step { assert(!is_public); from_first ! number, state }
#ifdef BUG_BEGUN_LATE
       begin();
#endif
#ifndef BUG_ENDED_EARLY
       end();
#endif
#ifdef BUG_SLEEPERS_READ_FIRST
       if
       :: sleepers != 0 -> progress++; is_asleep = false
       :: else -> progress++
       fi;
#else
       progress++;
#ifndef BUG_NOBODY_WOKEN
       if
       :: sleepers != 0 -> is_asleep = false
       :: else
       fi;
#endif
#endif
       atomic { is_running = false; kind = 0 }
    od
  } unless { dies[self] || stands[self] };
#ifdef BUG_NO_LIMIT
end_standing:
#endif
  dies[self];
  d_step { life = life | (1 << self); is_asleep = false }
}

inline kill() {
  dies[0] = true;
#if WORKERS > 1
  dies[1] = true;
#endif
  life == ALL_ENDED
}

proctype Supervisor() {
  if
  :: true /* nobody is killed */
  :: true ->
#ifdef BUG_NOT_FENCED
     if
     :: kill()
     :: true /* it goes on */
     fi
#else
     kill()
#endif
     ;
     d_step { is_announced = false; is_asleep = false }
#ifdef STANDS
  :: true ->
     if
     :: stands[0] = true
#if WORKERS > 1
     :: stands[1] = true
#endif
     fi;
#ifndef BUG_NO_LIMIT
     kill();
     d_step { is_announced = false; is_asleep = false }
#endif
#endif
  fi
}

#ifdef BUG_FIRST_WORKER
#define HAS_ENDED (life != 0)
#else
#define HAS_ENDED (life == ALL_ENDED || !is_announced)
#endif

/* Makes known what stands in `worker`'s ring at `next`. */
#define PENDING(n) pending[(n) - 1]

inline read_ring(worker) {
  size = begun[worker];
  do
  :: next[worker] < size ->
     atomic {
       if
       :: outcome[RECORD(worker, next[worker])] == RUNS ->
#ifdef BUG_ENDED_ONLY
          next[worker]++
#else
          break
#endif
       :: else ->
          PENDING(number_of[RECORD(worker, next[worker])]) = kind_of[RECORD(worker, next[worker])] + 1;
          next[worker]++
       fi
     }
  :: else -> break
  od;
  size = 0
}

inline read_rings() {
  read_ring(0);
#if WORKERS > 1
  read_ring(1)
#endif
}

inline add_begun(worker) {
  if
  :: next[worker] < begun[worker] ->
     PENDING(number_of[RECORD(worker, next[worker])]) = kind_of[RECORD(worker, next[worker])] + 1
  :: else
  fi
}

inline drain() {
  atomic {
    if
    :: given > published -> published = given; did = true
    :: else
    fi
  }
}

inline take_over() {
#ifndef BUG_NOT_DRAINED
  drain();
#endif
#ifndef BUG_READ_BEFORE_THE_END
  read_rings();
#endif
#ifndef BUG_BEGUN_LEFT_OUT
  atomic {
    add_begun(0);
#if WORKERS > 1
    add_begun(1)
#endif
  }
#endif
  did = true
}

/* Executes an activation with an input of this kind. */
inline execute(its_kind) {
  d_step {
    used[its_kind]++;
    own = 3 * own + its_kind + 1;
    executed++;
    assert(history[executed] == 0 || history[executed] == own || is_over);
    if
    :: is_followed -> made++; sequence = made
    :: else -> published++; sequence = published
    fi
  }
  if
#ifdef BUG_MUTED_TO_THE_END
  :: is_taking_over && is_over ->
#else
  :: is_public ->
#endif
     atomic {
       from_second ! sequence, own;
       if
       :: is_followed && sequence > published -> published = sequence; is_followed = false
       :: is_followed && sequence == published -> is_followed = false
       :: else
       fi
     }
  :: else
  fi;
  sequence = 0;
  did = true
}

#define CAME(kind) (came_second[kind] > used[kind])

/* What is next; 0: nothing that is known. */
#define NEXT (executed < INPUTS -> PENDING(executed + 1) : 0)

inline serve() {
  if
  :: !is_over && is_taking_over && !is_public ->
     atomic {
       is_public = true;
       if
       :: made >= published -> is_followed = false
       :: else
       fi
     }
  :: else
  fi;
  if
  :: is_over ->
     if
     :: CAME(0) -> execute(0)
     :: CAME(1) -> execute(1)
     :: else
     fi
  :: !is_over && NEXT != 0 ->
     if
     :: CAME(NEXT - 1) ->
        atomic { chosen = NEXT - 1 };
        execute(chosen);
        chosen = 0
#ifdef BUG_INPUT_NOT_AWAITED
     :: !CAME(NEXT - 1) && CAME(2 - NEXT) ->
        atomic { chosen = 2 - NEXT };
        execute(chosen);
        chosen = 0
#endif
     :: else
     fi
  :: !is_over && NEXT == 0 && is_taking_over -> is_over = true; did = true
  :: else
  fi
}

#define HAS_NEWS (progress != seen || (!is_taking_over && HAS_ENDED))
#define HAS_ANY (given > published || (is_over && (CAME(0) || CAME(1))) || (!is_over && NEXT != 0 && CAME(NEXT - 1)))

proctype Second() {
  byte next[WORKERS], pending[INPUTS], used[2];
  byte seen, size, own, made, published, sequence, chosen;
  byte watched, watched_life, watched_inputs;
  bool is_taking_over, is_followed = true, did, watched_announced;
  do
  :: drain();
     if
#ifdef BUG_PROGRESS_READ_LATE
     :: progress != seen -> read_rings(); seen = progress; did = true
#else
     :: atomic { progress != seen -> seen = progress; did = true }
        read_rings()
#endif
     :: else
     fi;
     if
     :: atomic { !is_taking_over && HAS_ENDED -> is_taking_over = true }
        take_over()
     :: else
     fi;
     atomic { serve() };
     if
     :: did -> did = false
     :: else ->
#ifdef BUG_LOOKS_FIRST
        did = HAS_NEWS || HAS_ANY;
        sleepers++;
        d_step {
          watched = progress; watched_life = life; watched_announced = is_announced;
          watched_inputs = came_second[0] + came_second[1] + given
        }
#else
        sleepers++;
        d_step {
          watched = progress; watched_life = life; watched_announced = is_announced;
          watched_inputs = came_second[0] + came_second[1] + given
        }
        did = HAS_NEWS || HAS_ANY;
#endif
        if
        :: did
        :: else ->
           d_step { /* futex_waitv */
             is_asleep = (watched == progress && watched_inputs == came_second[0] + came_second[1] + given
#ifndef BUG_END_NOT_WATCHED
                          && watched_life == life && watched_announced == is_announced
#endif
                          )
           }
end_asleep:
           !is_asleep
        fi;
        d_step { sleepers--; watched = 0; watched_life = 0; watched_inputs = 0; watched_announced = false; did = false }
     fi
  od
}

inline accept(is_second) {
  if
  :: sequence <= last /* dropped */
  :: else ->
     assert(sequence == last + 1);
     assert(is_second || !has_second);
     assert(value / 3 == content);
     has_second = is_second;
     last = sequence;
     content = value
  fi;
  sequence = 0;
  value = 0
}

proctype Receiver() {
  byte sequence, value;
end_receiving:
  do
  :: atomic { from_first ? sequence, value -> accept(false) }
  :: nempty(from_second) ->
     do
     :: atomic { from_first ? sequence, value -> accept(false) }
     :: empty(from_first) -> break
     od;
     atomic { from_second ? sequence, value -> accept(true) }
  od
}

init {
  atomic {
    run Source(0);
    run Source(1);
    run First(0);
#if WORKERS > 1
    run First(1);
#endif
    run Supervisor();
    run Second();
    run Receiver()
  }
  timeout -> assert(last == INPUTS && executed == INPUTS)
}
