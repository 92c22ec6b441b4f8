/*
 * A lane between processes, in which every shared word has one writer.
 *
 * Mirrors  the publishing end (loan, publish, push, take back, collect) and the receiving end (take,
 *          give back) of a lane between processes (src/processes), as docs/memory_order.md describes
 *          them under "Between processes".
 * Leaves out  waking (process_bell.pml), ends of processes (process_generations.pml), messages that
 *          are forwarded, which are copied. Positions are not 48 bits wide, but no run comes near
 *          their end. drop_newest, which leaves the slot alone.
 * Checks   a message is written only while no honest receiver holds it, and what such a receiver reads
 *          is the message of the position that it took; no reference is given back twice; when all is
 *          still and everything was returned, every message is free; an honest receiver is never
 *          refused for its quota; with a hostile one beside it, which returns and announces anything,
 *          the pool is never dry.
 *
 * The publisher's own: slots (position and pool slot in one word), `tail`, and privately the table of
 * holds, which alone decides. The receiver's own: `taking`, and a ring of returns with its count
 * `returned`. To drop the oldest the publisher closes its slot, then reads `taking`; the receiver writes
 * `taking`, then reads the slot again. At least one of them sees the other.
 *
 * A receiver may keep KEEP messages beside the one that it reads. HOSTILE: the last receiver is one.
 *
 * run short: one receiver, depth 1              -DMESSAGES=4
 * run short: depth 2                            -DDEPTH=2 -DMESSAGES=4
 * run short: it keeps one                       -DKEEP=1 -DMESSAGES=4
 * run short: two receivers                      -DRECEIVERS=2 -DMESSAGES=2
 * run short: a hostile receiver alone           -DHOSTILE -DFORGERIES=2 -DMESSAGES=3
 * run long: two receivers, three messages       -DRECEIVERS=2 -DMESSAGES=3
 * run long: depth 2, it keeps one               -DDEPTH=2 -DKEEP=1 -DMESSAGES=6
 * run long: an honest receiver beside a hostile one  -DRECEIVERS=2 -DHOSTILE -DFORGERIES=2 -DMESSAGES=3
 * run long: a hostile receiver that goes on     -DHOSTILE -DFORGERIES=3 -DMESSAGES=3
 * run long: the hostile one, depth 2            -DHOSTILE -DDEPTH=2 -DFORGERIES=4 -DMESSAGES=4
 * bug BUG_TAKING_READ_FIRST: `taking` is read before the slot is closed           -DMESSAGES=3
 * bug BUG_NOT_CLOSED: the oldest slot is not closed before `taking` is read       -DMESSAGES=3
 * bug BUG_NO_SECOND_LOOK: the receiver does not look at the slot again            -DMESSAGES=3
 * bug BUG_TAKEN_LATE: the receiver announces what it takes after its second look  -DMESSAGES=3
 * bug BUG_RACED_KEPT: who loses the race for a message does not return it         -DMESSAGES=4
 * bug BUG_BLIND_RETURN: a return is believed without the table                    -DMESSAGES=3
 * bug BUG_INDEX_ONLY: a return is compared by the pool's slot alone               -DMESSAGES=4
 * bug BUG_RETURNED_FIRST: a message is returned before it was read                -DMESSAGES=3
 * bug BUG_COUNTED_FIRST: a return is counted before it stands in the ring         -DMESSAGES=3
 * bug BUG_FREED_UNSEEN: what is dropped is free without a look at `taking`        -DMESSAGES=3
 * bug BUG_SHORT_RING: the ring of returns has less room than the quota            -DKEEP=2 -DMESSAGES=6 -DRING=1
 * bug BUG_NO_QUOTA: a receiver holds as much as it likes          -DHOSTILE -DFORGERIES=2 -DMESSAGES=4
 * bug BUG_QUOTA_STALE: who seems to hold too much is refused without looking for returns  -DMESSAGES=4
 * bug BUG_TAKING_BELIEVED: what `taking` says was taken is no longer in the table -DMESSAGES=3
 */
#ifndef RECEIVERS
#define RECEIVERS 1
#endif
#ifndef DEPTH
#define DEPTH 1
#endif
#ifndef KEEP
#define KEEP 0
#endif
#ifndef FORGERIES
#define FORGERIES 0
#endif
#define QUOTA (DEPTH + KEEP + 1)
#ifndef RING
#define RING (QUOTA + 1) /* one more for a message that was raced for, and taken back meanwhile */
#endif
#define POOL (RECEIVERS * QUOTA + 1)
#define NONE 255
#define CLOSING 254

#ifdef HOSTILE
#define HONEST (RECEIVERS - 1)
#else
#define HONEST RECEIVERS
#endif

#define WORD(position, index) ((position) * POOL + (index))
#define POSITION(word) ((word) / POOL)
#define INDEX(word) ((word) % POOL)
#define SLOT(receiver, position) ((receiver) * DEPTH + (position) % DEPTH)
#define RETURN(receiver, count) ((receiver) * RING + (count) % RING)
#define GIVEN(receiver, index) ((receiver) * POOL + (index))

/* Shared, the publisher's. */
byte slots[RECEIVERS * DEPTH];
byte tail[RECEIVERS];
byte content[POOL]; /* envelope and message */

/* Shared, each receiver's. */
byte taking[RECEIVERS], returned[RECEIVERS];
byte returns[RECEIVERS * RING];

/* The publisher's private memory. */
byte references[POOL];
byte given[RECEIVERS * POOL]; /* position + 1; 0: not given */
byte count[RECEIVERS];        /* of what each holds */
byte returns_read[RECEIVERS];

/* What is observed. */
byte readers[POOL]; /* honest ones */
byte published_at[RECEIVERS * MESSAGES]; /* the message of each position */
byte receivers_ended = 0;
bool publisher_ended = false;

/* Takes back what `receiver` held at `position` in `index`, if the table says that it does. */
inline take_back(receiver, position, index) {
  d_step {
    if
#ifdef BUG_BLIND_RETURN
    :: true ->
#elif defined(BUG_INDEX_ONLY)
    :: given[GIVEN(receiver, index)] != 0 ->
#else
    :: given[GIVEN(receiver, index)] == (position) + 1 ->
#endif
       given[GIVEN(receiver, index)] = 0;
       count[receiver]--;
       assert(references[index] > 0);
       references[index]--;
       was_held = true
    :: else -> was_held = false
    fi
  }
}

inline collect(receiver) {
  seen = returned[receiver];
  do
  :: returns_read[receiver] != seen ->
     word = returns[RETURN(receiver, returns_read[receiver])];
     if
     :: word != NONE -> take_back(receiver, POSITION(word), INDEX(word))
     :: else
     fi;
     d_step { returns_read[receiver]++; word = 0; was_held = false }
  :: else -> break
  od;
  seen = 0
}

inline push(receiver) {
  if
  :: tail[receiver] >= DEPTH ->
     old = slots[SLOT(receiver, tail[receiver])];
#ifdef BUG_TAKING_READ_FIRST
     is_taken = taking[receiver] > tail[receiver] - DEPTH;
     slots[SLOT(receiver, tail[receiver])] = CLOSING;
#else
#ifndef BUG_NOT_CLOSED
     slots[SLOT(receiver, tail[receiver])] = CLOSING;
#endif
     is_taken = taking[receiver] > tail[receiver] - DEPTH;
#endif
#ifdef BUG_FREED_UNSEEN
     is_taken = false;
#endif
     if
     :: old == CLOSING /* it was refused for its quota */
     :: old != CLOSING && !is_taken -> take_back(receiver, tail[receiver] - DEPTH, INDEX(old))
#ifdef BUG_TAKING_BELIEVED
     :: old != CLOSING && is_taken ->
        d_step { given[GIVEN(receiver, INDEX(old))] = 0; count[receiver]-- }
#else
     :: old != CLOSING && is_taken
#endif
     fi;
     atomic { is_taken = false; was_held = false }
  :: else
  fi;
#ifndef BUG_QUOTA_STALE
  if
  :: count[receiver] == QUOTA -> collect(receiver)
  :: else
  fi;
#endif
  if
#ifndef BUG_NO_QUOTA
  :: count[receiver] == QUOTA ->
     assert(receiver >= HONEST);
     if
     :: tail[receiver] >= DEPTH -> slots[SLOT(receiver, tail[receiver])] = old
     :: else
     fi
#endif
  :: else ->
     d_step {
       assert(given[GIVEN(receiver, mine)] == 0);
       given[GIVEN(receiver, mine)] = tail[receiver] + 1;
       count[receiver]++;
       references[mine]++;
       published_at[receiver * MESSAGES + tail[receiver]] = message
     }
     slots[SLOT(receiver, tail[receiver])] = WORD(tail[receiver], mine);
     tail[receiver] = tail[receiver] + 1
  fi;
  old = 0
}

proctype Publisher() {
  byte message = 1, mine, receiver, seen, word, old;
  bool is_taken, was_held;
  do
  :: message <= MESSAGES ->
     receiver = 0;
     do
     :: receiver < RECEIVERS -> collect(receiver); receiver++
     :: else -> break
     od;
     receiver = 0;
     d_step {
       mine = 0;
       do
       :: mine < POOL && references[mine] > 0 -> mine++
       :: else -> break
       od;
       assert(mine < POOL); /* else: the pool is dry */
       references[mine] = 1 /* the publisher's own */
     }
     assert(readers[mine] == 0);
     content[mine] = message;
     do
     :: receiver < RECEIVERS -> push(receiver); receiver++
     :: else -> break
     od;
     receiver = 0;
     d_step { assert(references[mine] > 0); references[mine]--; mine = 0 }
     message++
  :: else -> break
  od;
  publisher_ended = true;
  /* What is still out comes back. */
  receivers_ended == HONEST;
  do
  :: receiver < RECEIVERS -> collect(receiver); receiver++
  :: else -> break
  od;
  receiver = 0;
  d_step {
    do
    :: receiver < HONEST -> assert(count[receiver] == 0); receiver++
    :: else -> break
    od;
    mine = 0;
    do
    :: mine < POOL ->
       assert(RECEIVERS != HONEST || references[mine] == 0);
       mine++
    :: else -> break
    od;
    mine = 0; receiver = 0
  }
}

inline give_back(what) {
#ifdef BUG_COUNTED_FIRST
  returned[self] = returned[self] + 1;
  returns[RETURN(self, returned[self] - 1)] = what
#else
  returns[RETURN(self, returned[self])] = what;
  returned[self] = returned[self] + 1
#endif
}

inline begin_read(what) {
  d_step {
    readers[INDEX(what)]++;
    assert(content[INDEX(what)] == published_at[self * MESSAGES + POSITION(what)])
  }
}

inline end_read(what) {
  d_step {
    assert(content[INDEX(what)] == published_at[self * MESSAGES + POSITION(what)]);
    readers[INDEX(what)]--
  }
}

proctype Receiver(byte self) {
  byte head, word, end, kept[KEEP + 1], kept_count;
  bool is_ours;
  do
  :: tail[self] > head ->
     word = slots[SLOT(self, head)];
     if
     :: word == CLOSING || POSITION(word) != head ->
        end = tail[self];
        atomic {
          if
          :: end > head + DEPTH -> head = end - DEPTH
          :: else /* the publisher is about to write it */
          fi;
          end = 0; word = 0
        }
     :: else ->
#ifdef BUG_TAKEN_LATE
        is_ours = slots[SLOT(self, head)] == word;
        taking[self] = head + 1;
#else
        taking[self] = head + 1;
        is_ours = slots[SLOT(self, head)] == word;
#endif
#ifdef BUG_NO_SECOND_LOOK
        is_ours = true;
#endif
        head++;
        if
        :: is_ours ->
           begin_read(word);
           if
           :: kept_count < KEEP -> d_step { kept[kept_count] = word; kept_count++ }
           :: true ->
#ifdef BUG_RETURNED_FIRST
              give_back(word);
              end_read(word)
#else
              end_read(word);
              give_back(word)
#endif
           fi
        :: else ->
#ifndef BUG_RACED_KEPT
           give_back(word)
#endif
        fi;
        d_step { word = 0; is_ours = false }
     fi
  :: kept_count > 0 ->
     kept_count--;
     end_read(kept[kept_count]);
     give_back(kept[kept_count]);
     kept[kept_count] = 0
  :: tail[self] == head && publisher_ended && kept_count == 0 -> break
  od;
  receivers_ended++
}

#ifdef HOSTILE
/* Writes anything into what it may write, in any order. */
proctype Hostile(byte self) {
  byte forged, position, index;
  do
  :: forged < FORGERIES ->
     position = 0; index = 0;
     do
     :: position < MESSAGES -> position++
     :: break
     od;
     do
     :: index < POOL - 1 -> index++
     :: break
     od;
     if
     :: taking[self] = position
     :: returns[RETURN(self, returned[self])] = WORD(position, index);
        returned[self] = returned[self] + 1
     fi;
     forged++
  :: break
  od
}
#endif

init {
  byte i;
  atomic {
    do
    :: i < RECEIVERS * DEPTH -> slots[i] = CLOSING; i++
    :: else -> break
    od;
    i = 0;
    do
    :: i < RECEIVERS * RING -> returns[i] = NONE; i++
    :: else -> break
    od;
    i = 0;
    run Publisher();
    do
    :: i < HONEST -> run Receiver(i); i++
    :: else -> break
    od;
#ifdef HOSTILE
    run Hostile(RECEIVERS - 1);
#endif
    i = 0
  }
}
