/*
 * A message's count of references, and the pool that it goes back to.
 *
 * Mirrors  retain, release, recycle (include/fastcycle/detail/envelope.h, src/broker/pool.cc);
 *          Pool::take, collect, give_back, close, forget (src/broker/pool.{h,cc}); the count that
 *          PublisherCore::deliver stores, and the reference that forward takes
 *          (src/broker/publisher_core.cc).
 * Leaves out  lanes, which are channels of depth 1 here; a publisher that finds one full takes the
 *          oldest out and lets go of it, as Lane::push does. Growing: a dry pool publishes
 *          nothing. Latched messages, which are one more holder.
 * Checks   a message is written only while nobody holds it, and never read after that; nothing is
 *          freed twice or used after it was freed, neither a message nor a pool; when all is still,
 *          everything is freed, and nothing was lost.
 *
 * A publisher with BLOCKS messages publishes PUBLISHED times, to a reader and to a forwarder, then
 * closes its pool. The forwarder hands each message on to a second reader in an envelope of its
 * own, then closes its own pool while that one still reads.
 *
 * run short: two messages, published twice         -DPUBLISHED=2
 * run short: one message, published three times    -DBLOCKS=1 -DPUBLISHED=3
 * run short: two readers, three messages           -DNO_FORWARDER -DBLOCKS=3 -DPUBLISHED=4
 * run long: two messages, published three times    -DPUBLISHED=3
 * run long: three messages, two to forward with    -DBLOCKS=3 -DENVELOPES=2 -DPUBLISHED=3
 * run long: two readers, published six times       -DNO_FORWARDER -DBLOCKS=3 -DPUBLISHED=6
 * bug BUG_COUNTED_LATE: the count is stored after the pushes                 -DPUBLISHED=2
 * bug BUG_COUNTED_BY_PUSH: the count grows with each push                    -DPUBLISHED=2
 * bug BUG_COUNT_READ_AGAIN: the count is read again after letting go         -DPUBLISHED=2
 * bug BUG_RETAINED_LATE: a forwarder lets go before it takes its reference   -DPUBLISHED=2
 * bug BUG_STACK_IN_TWO_STEPS: the stack is read, then emptied                -DPUBLISHED=2
 * bug BUG_BLIND_RETURN: an entry is put on the stack without comparing it    -DNO_FORWARDER -DBLOCKS=2 -DPUBLISHED=2
 * bug BUG_NO_CLOSED_MARK: a closed pool leaves no mark                       -DPUBLISHED=1
 * bug BUG_OWNER_NOT_COUNTED: the owner that closes its pool does not count itself  -DPUBLISHED=1
 */
#ifndef BLOCKS
#define BLOCKS 2
#endif
#ifdef NO_FORWARDER
#define ENVELOPES 0
#define POOLS 1
#else
#ifndef ENVELOPES
#define ENVELOPES 1
#endif
#define POOLS 2
#endif
#define ALL (BLOCKS + ENVELOPES)
#define POOL_OF(envelope) ((envelope) >= BLOCKS)
#define NIL 100
#define CLOSED 101

/* The envelopes: those of the publisher, then those of the forwarder. */
byte references[ALL], next[ALL], foreign[ALL];
bool is_freed[ALL];
byte holders[ALL]; /* observed: who may read it now */
bool is_lent[ALL]; /* observed: taken from the pool, not given back */

/* The pools. */
byte free[POOLS], returned[POOLS], outstanding[POOLS];
byte pool_freed[POOLS];

chan to_reader = [1] of {byte};
chan to_forwarder = [1] of {byte};
chan to_last = [1] of {byte};
byte ended = 0;
bool publisher_ended = false, forwarder_ended = false;

#define alive(pool) assert(pool_freed[pool] == 0)

inline free_envelope(e) {
  assert(!is_freed[e] && holders[e] == 0);
  is_freed[e] = true
}

inline forget(pool, amount) {
  d_step {
    alive(pool);
    assert(outstanding[pool] >= (amount));
    is_last = outstanding[pool] == (amount);
    outstanding[pool] = outstanding[pool] - (amount)
  }
  if
  :: is_last -> alive(pool); pool_freed[pool]++; is_last = false
  :: else
  fi
}

inline give_back(e) {
  atomic { alive(POOL_OF(e)); assert(is_lent[e]); is_lent[e] = false; top = returned[POOL_OF(e)] }
  do
  :: top == CLOSED -> d_step { free_envelope(e) }; forget(POOL_OF(e), 1); break
  :: else ->
     next[e] = top;
     atomic {
       alive(POOL_OF(e));
       if
#ifdef BUG_BLIND_RETURN
       :: true -> returned[POOL_OF(e)] = e; break
#else
       :: returned[POOL_OF(e)] == top -> returned[POOL_OF(e)] = e; break
       :: else -> top = returned[POOL_OF(e)]
#endif
       fi
     }
  od;
  top = 0
}

/* Lets go of one reference; `is_last` says whether it was the last one. */
inline let_go(e) {
  atomic { assert(!is_freed[e] && references[e] > 0); is_last = references[e] == 1 }
  if
  :: is_last -> references[e] = 0 /* the only holder: nobody else can add one */
  :: else ->
     d_step {
       assert(!is_freed[e] && references[e] > 0);
       references[e]--;
       is_last = references[e] == 0
     }
  fi;
#ifdef BUG_COUNT_READ_AGAIN
  is_last = references[e] == 0;
#endif
}

/* release() and recycle(); an envelope whose payload is foreign refers to one whose is not. */
inline release(e) {
  let_go(e);
  if
  :: is_last ->
     is_last = false;
     other = foreign[e];
     foreign[e] = NIL;
     if
     :: other != NIL ->
        let_go(other);
        if
        :: is_last -> is_last = false; give_back(other)
        :: else
        fi
     :: else
     fi;
     other = 0;
     give_back(e)
  :: else
  fi
}

/* Pool::collect, at the first loan of an activation. */
inline collect(pool) {
  if
  :: returned[pool] != NIL ->
     atomic { top = returned[pool]; returned[pool] = NIL }
     d_step {
       do
       :: top != NIL -> mine = next[top]; next[top] = free[pool]; free[pool] = top; top = mine
       :: else -> break
       od;
       top = 0; mine = 0
     }
  :: else
  fi
}

/* Pool::take; the envelope, or NIL, is in `mine`. */
inline take(pool) {
  if
  :: free[pool] == NIL ->
#ifdef BUG_STACK_IN_TWO_STEPS
     free[pool] = returned[pool];
     returned[pool] = NIL
#else
     atomic { free[pool] = returned[pool]; returned[pool] = NIL }
#endif
  :: else
  fi;
  d_step {
    mine = free[pool];
    if
    :: mine != NIL ->
       free[pool] = next[mine];
       assert(!is_lent[mine] && holders[mine] == 0 && references[mine] == 0);
       is_lent[mine] = true
    :: else
    fi
  }
}

inline close(pool) {
  d_step {
    freed = 0;
    do
    :: free[pool] != NIL ->
       mine = free[pool]; free[pool] = next[mine]; free_envelope(mine); freed++
    :: else -> break
    od
  }
#ifdef BUG_NO_CLOSED_MARK
  atomic { alive(pool); free[pool] = returned[pool]; returned[pool] = NIL }
#else
  atomic { alive(pool); free[pool] = returned[pool]; returned[pool] = CLOSED }
#endif
  d_step {
    do
    :: free[pool] != NIL ->
       mine = free[pool]; free[pool] = next[mine]; free_envelope(mine); freed++
    :: else -> break
    od;
    mine = 0
  }
#ifdef BUG_OWNER_NOT_COUNTED
  forget(pool, freed);
#else
  forget(pool, freed + 1);
#endif
  freed = 0
}

/* Lane::push into a lane of depth 1. */
inline push(lane, e) {
#ifdef BUG_COUNTED_BY_PUSH
  references[e]++;
#endif
  atomic {
    displaced = NIL;
    if
    :: full(lane) -> lane?displaced
    :: empty(lane)
    fi;
    lane!e
  }
  if
  :: displaced != NIL -> release(displaced)
  :: else
  fi;
  displaced = 0
}

proctype Publisher() {
  byte mine, i, displaced, other, top, freed;
  bool is_last;
  do
  :: i < PUBLISHED ->
     if
     :: collect(0)
     :: true
     fi;
     take(0);
     if
     :: mine != NIL ->
        assert(holders[mine] == 0); /* it is written here */
#if !defined(BUG_COUNTED_LATE) && !defined(BUG_COUNTED_BY_PUSH)
        references[mine] = 2;
#endif
        push(to_reader, mine);
        push(to_forwarder, mine);
#ifdef BUG_COUNTED_LATE
        references[mine] = 2
#endif
     :: else
     fi;
     i++
  :: else -> break
  od;
  close(0);
  publisher_ended = true;
  ended++
}

inline read(e) {
  d_step { assert(!is_freed[e] && is_lent[e]); holders[e]++ }
  d_step { assert(!is_freed[e] && is_lent[e]); holders[e]-- }
}

proctype Reader(chan lane) {
  byte got, other, top;
  bool is_last;
  do
  :: lane?got -> read(got); release(got); got = 0
  :: empty(lane) && publisher_ended && (forwarder_ended || lane == to_reader) -> break
  od;
  ended++
}

#ifdef NO_FORWARDER
#define FORWARDERS 0
#else
#define FORWARDERS 1
proctype Forwarder() {
  byte got, mine, displaced, other, top, freed;
  bool is_last;
  do
  :: to_forwarder?got ->
     read(got);
     take(1);
     if
     :: mine != NIL ->
#ifdef BUG_RETAINED_LATE
        release(got);
        d_step { references[got]++; foreign[mine] = got }
#else
        d_step { assert(references[got] > 0); references[got]++; foreign[mine] = got }
#endif
        references[mine] = 1;
        push(to_last, mine)
     :: else
     fi;
#ifdef BUG_RETAINED_LATE
     if
     :: mine == NIL -> release(got)
     :: else
     fi;
#else
     release(got);
#endif
     atomic { mine = 0; got = 0 }
  :: empty(to_forwarder) && publisher_ended -> break
  od;
  close(1);
  forwarder_ended = true;
  ended++
}

/* Reads what was forwarded: the envelope of the one, the payload of the other. */
proctype Last() {
  byte got, other, top;
  bool is_last;
  do
  :: to_last?got ->
     d_step { holders[got]++; holders[foreign[got]]++; assert(is_lent[foreign[got]]) }
     d_step { assert(is_lent[foreign[got]]); holders[got]--; holders[foreign[got]]-- }
     release(got);
     got = 0
  :: empty(to_last) && forwarder_ended -> break
  od;
  ended++
}
#endif

init {
  byte i;
  atomic {
    do
    :: i < ALL -> next[i] = i + 1; foreign[i] = NIL; i++
    :: else -> break
    od;
    next[BLOCKS - 1] = NIL;
    free[0] = 0; returned[0] = NIL;
    outstanding[0] = BLOCKS;
#if FORWARDERS
    next[ALL - 1] = NIL;
    free[1] = BLOCKS; returned[1] = NIL;
    outstanding[1] = ENVELOPES;
#endif
#ifndef BUG_OWNER_NOT_COUNTED
    i = 0;
    do
    :: i < POOLS -> outstanding[i]++; i++
    :: else -> break
    od;
#endif
    run Publisher();
    run Reader(to_reader);
#if FORWARDERS
    run Forwarder();
    run Last()
#else
    forwarder_ended = true;
    run Reader(to_forwarder)
#endif
  }
  timeout -> d_step {
    assert(ended == 3 + FORWARDERS);
    i = 0;
    do
    :: i < ALL -> assert(is_freed[i]); i++
    :: else -> break
    od;
    i = 0;
    do
    :: i < POOLS -> assert(pool_freed[i] == 1 && outstanding[i] == 0); i++
    :: else -> break
    od
  }
}
