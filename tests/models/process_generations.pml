/*
 * Processes that end and come again, while messages of theirs are held and theirs are held elsewhere.
 *
 * Mirrors  the supervisor's word per process (its incarnation, 0 while it is dead), the choice of a
 *          generation of its segment for the next one, attaching and accepting, forgetting what a dead
 *          receiver held (src/processes), as docs/memory_order.md describes them under "Between
 *          processes".
 * Leaves out  dropping (remote_lane.pml) and waking (process_bell.pml): a publisher stops where its
 *          lane is full. What is reported of several processes, which is a word for each.
 * Checks   what a receiver reads is what was published, whatever ends meanwhile; a message is
 *          written only while no living receiver reads it, also where its memory was that of an
 *          earlier incarnation; a receiver gets only what was pushed for itself; when all is still,
 *          nothing is held any more, and nobody waits for ever.
 *
 * One publisher and one receiver, each killed at any step: its process goes on no more, then the
 * supervisor, who waited for that, announces it, and starts the next one. Incarnation n of the publisher has
 * generation n modulo GENERATIONS of its segment. `oldest` is the receiver's: the oldest incarnation of the
 * publisher of which it may still touch anything. Generation n is used again when `oldest` is beyond n.
 *
 * To attach, the receiver empties its page, then says so with both incarnations (`attached`). The
 * publisher, which has forgotten the receiver's predecessor, answers with both, after the position from
 * which on the lane is this receiver's (`accepted`, `first`). Nothing is pushed or taken back before.
 *
 * PUBLISHER_ENDS, RECEIVER_ENDS: how often each is killed, at most. The receiver may keep a message. Each
 * publisher publishes UNHEARD more while nobody is attached.
 *
 * run short: nobody ends                      -DMESSAGES=2
 * run short: the receiver ends                -DRECEIVER_ENDS=1 -DMESSAGES=2
 * run short: the publisher ends               -DPUBLISHER_ENDS=1 -DMESSAGES=1
 * run short: a generation is used again       -DPUBLISHER_ENDS=2 -DMESSAGES=1
 * run short: the receiver ends, and some are for nobody  -DRECEIVER_ENDS=1 -DMESSAGES=2 -DUNHEARD=1
 * run short: both end                         -DPUBLISHER_ENDS=1 -DRECEIVER_ENDS=1 -DMESSAGES=1
 * run long: both end, two messages            -DPUBLISHER_ENDS=1 -DRECEIVER_ENDS=1 -DMESSAGES=2
 * run long: a generation is used again, two messages  -DPUBLISHER_ENDS=2 -DMESSAGES=2
 * run long: a generation is used again, the receiver ends  -DPUBLISHER_ENDS=2 -DRECEIVER_ENDS=1 -DMESSAGES=1
 * run long: the receiver ends twice           -DRECEIVER_ENDS=2 -DMESSAGES=3
 * bug BUG_ANNOUNCED_EARLY: a receiver is announced dead when it is killed, not when it has ended  -DRECEIVER_ENDS=1 -DMESSAGES=2 -DUNHEARD=1
 * bug BUG_NOT_FORGOTTEN: what a dead receiver held stays in the table           -DRECEIVER_ENDS=1 -DMESSAGES=2
 * bug BUG_ATTACHED_AT_TAIL: a receiver begins at `tail`, without the publisher's answer  -DRECEIVER_ENDS=1 -DMESSAGES=3
 * bug BUG_RETURNS_GO_ON: returns of a new receiver are not counted from 0      -DRECEIVER_ENDS=1 -DMESSAGES=3
 * bug BUG_ATTACHED_TO_ANY: `attached` names the receiver alone                  -DPUBLISHER_ENDS=1 -DMESSAGES=2
 * bug BUG_ACCEPTED_BY_ANY: `accepted` names the receiver alone                  -DPUBLISHER_ENDS=2 -DMESSAGES=1
 * bug BUG_USED_AT_ONCE: a generation is used again without asking who holds it  -DPUBLISHER_ENDS=2 -DMESSAGES=1
 * bug BUG_LETS_GO_EARLY: a receiver that attaches says that it holds nothing older  -DPUBLISHER_ENDS=2 -DMESSAGES=1
 * bug BUG_REPORTS_WHEN_ATTACHING: a receiver says what it holds only when it attaches  -DPUBLISHER_ENDS=2 -DMESSAGES=1
 * bug BUG_OLD_RETURNED: what is left of a dead publisher is returned to the next one  -DPUBLISHER_ENDS=1 -DMESSAGES=2
 */
#ifndef PUBLISHER_ENDS
#define PUBLISHER_ENDS 0
#endif
#ifndef RECEIVER_ENDS
#define RECEIVER_ENDS 0
#endif
#ifndef UNHEARD
#define UNHEARD 0
#endif
#define GENERATIONS 2
#define POOL 2
#define LANE MESSAGES
#define RING (LANE + 2)
#define NONE 255
#define BOTH(receiver, publisher) ((receiver) * 16 + (publisher))
#define GENERATION(publisher) ((publisher) % GENERATIONS)
#define SLOT(publisher, position) (GENERATION(publisher) * LANE + (position))
#define BLOCK(publisher, index) (GENERATION(publisher) * POOL + (index))
#define WORD(position, index) ((position) * POOL + (index))
#define POSITION(word) ((word) / POOL)
#define INDEX(word) ((word) % POOL)

/* The supervisor's. */
byte publisher_now = 0, receiver_now = 0; /* incarnations; 0: dead */
byte publisher_last = 0;                  /* the last one that was begun */

/* The publisher's segment, by generation. */
byte slots[GENERATIONS * LANE];
byte tail[GENERATIONS], accepted[GENERATIONS], first[GENERATIONS];
byte content[GENERATIONS * POOL];

/* The receiver's page, emptied by each incarnation. */
byte attached = 0, returned = 0, oldest = 0;
byte returns[RING];

/* Who is killed, and has ended. */
bool kill_publisher = false, kill_receiver = false;
bool publisher_dead = false, receiver_dead = false;
bool is_over = false; /* nobody is killed any more */

/* What is observed. */
byte readers[GENERATIONS * POOL];
byte numbers = 0;
byte published_at[GENERATIONS * LANE], meant_for[GENERATIONS * LANE];
bool is_empty = false; /* the publisher's table, at the end */

inline forget() {
  d_step {
    index = 0;
    do
    :: index < POOL -> given[index] = 0; index++
    :: else -> break
    od;
    index = 0
  }
}

/* Looks who the receiver is now. */
inline look() {
  now = receiver_now;
  if
  :: now != known ->
#ifndef BUG_NOT_FORGOTTEN
     forget();
#endif
     known = now;
     is_accepted = false
  :: else
  fi;
  now = 0;
  if
#ifdef BUG_ATTACHED_TO_ANY
  :: known != 0 && !is_accepted && attached / 16 == known ->
#else
  :: known != 0 && !is_accepted && attached == BOTH(known, self) ->
#endif
#ifndef BUG_RETURNS_GO_ON
     returns_read = 0;
#endif
     first[GENERATION(self)] = tail[GENERATION(self)];
#ifdef BUG_ACCEPTED_BY_ANY
     accepted[GENERATION(self)] = BOTH(known, 0);
#else
     accepted[GENERATION(self)] = BOTH(known, self);
#endif
     is_accepted = true
  :: else
  fi
}

inline collect() {
  do
  :: is_accepted && returns_read < returned ->
     word = returns[returns_read];
     d_step {
       if
       :: word != NONE && given[INDEX(word)] == POSITION(word) + 1 -> given[INDEX(word)] = 0
       :: else
       fi;
       returns_read++;
       word = 0
     }
  :: else -> break
  od
}

proctype Publisher(byte self) {
  byte given[POOL], known, now, returns_read, word, index, unheard = UNHEARD;
  bool is_accepted;
  {
    /* Its segment, which an earlier one may have had. */
    d_step { tail[GENERATION(self)] = 0; index = 0 }
    do
    :: index < LANE -> slots[SLOT(self, index)] = NONE; index++
    :: else -> break
    od;
    index = 0;
    do
    :: tail[GENERATION(self)] < LANE && !is_over ->
       look();
       collect();
       index = 0;
       do
       :: index < POOL && given[index] != 0 -> index++
       :: else -> break
       od;
       if
       :: index < POOL && is_accepted ->
          assert(readers[BLOCK(self, index)] == 0);
          d_step { numbers++; content[BLOCK(self, index)] = numbers }
          d_step {
            given[index] = tail[GENERATION(self)] + 1;
            published_at[SLOT(self, tail[GENERATION(self)])] = content[BLOCK(self, index)];
            meant_for[SLOT(self, tail[GENERATION(self)])] = known
          }
          slots[SLOT(self, tail[GENERATION(self)])] = WORD(tail[GENERATION(self)], index);
          tail[GENERATION(self)] = tail[GENERATION(self)] + 1
       :: index < POOL && !is_accepted && unheard > 0 -> /* a message for nobody */
          unheard--;
          assert(readers[BLOCK(self, index)] == 0);
          d_step { numbers++; content[BLOCK(self, index)] = numbers }
       :: else
       fi;
       index = 0
    :: is_over -> break
    od;
    do /* Nothing stays with a receiver. */
    :: given[0] == 0 && given[1] == 0 -> break
    :: (given[0] != 0 || given[1] != 0) &&
       (receiver_now != known || (is_accepted && returns_read < returned)) ->
       look();
       collect()
    od;
    is_empty = true;
end_all:
    kill_publisher
  } unless { kill_publisher };
  publisher_dead = true
}

inline begin_read(what) {
  assert(what != NONE);
  d_step {
    readers[BLOCK(peer, INDEX(what))]++;
    assert(content[BLOCK(peer, INDEX(what))] == published_at[SLOT(peer, POSITION(what))]);
    assert(meant_for[SLOT(peer, POSITION(what))] == self)
  }
}

inline end_read(of_whom, what) {
  d_step {
    assert(readers[BLOCK(of_whom, INDEX(what))] > 0);
    readers[BLOCK(of_whom, INDEX(what))]--
  }
}

inline give_back(of_whom, what) {
  if
#ifdef BUG_OLD_RETURNED
  :: true ->
#else
  :: of_whom == peer && is_begun ->
#endif
     returns[returned] = what;
     returned = returned + 1
  :: else /* nobody counts any more */
  fi
}

inline let_go() {
  if
  :: kept == NONE && oldest < peer -> oldest = peer
  :: else
  fi
}

proctype Receiver(byte self) {
  byte peer, head, word, kept = NONE, kept_of, now;
  bool is_begun;
  {
    d_step { attached = 0; returned = 0 }
    peer = publisher_last;
    oldest = peer; /* none before that one will be touched */
    peer = 0;
end_receiving:
    do
    /* attach to the next one, when what the last one left is read */
    :: atomic { publisher_now != peer && publisher_now != 0 && (!is_begun || head >= tail[GENERATION(peer)]) -> now = publisher_now }
       attached = 0;
       atomic { peer = now; now = 0; is_begun = false; head = 0 }
#ifdef BUG_LETS_GO_EARLY
       oldest = peer;
#else
       let_go();
#endif
#ifdef BUG_ATTACHED_AT_TAIL
       head = tail[GENERATION(peer)];
       is_begun = true;
#endif
       returned = 0;
       attached = BOTH(self, peer)
#ifdef BUG_ACCEPTED_BY_ANY
    :: peer != 0 && !is_begun && accepted[GENERATION(peer)] == BOTH(self, 0) ->
#else
    :: peer != 0 && !is_begun && accepted[GENERATION(peer)] == BOTH(self, peer) ->
#endif
       head = first[GENERATION(peer)];
       is_begun = true
    :: is_begun && tail[GENERATION(peer)] > head ->
       word = slots[SLOT(peer, head)];
       head++;
       begin_read(word);
       if
       :: kept == NONE -> atomic { kept = word; kept_of = peer }
       :: true -> end_read(peer, word); give_back(peer, word)
       fi;
       word = 0
    :: kept != NONE ->
       end_read(kept_of, kept);
       give_back(kept_of, kept);
       d_step { kept = NONE; kept_of = 0 }
       let_go()
#ifndef BUG_REPORTS_WHEN_ATTACHING
    /* nothing is left of a dead one: another one may not come while this one says that it holds it */
    :: kept == NONE && (publisher_now != peer || peer == 0) && publisher_last > oldest &&
       (!is_begun || head >= tail[GENERATION(peer)]) ->
       now = publisher_last;
       atomic { peer = 0; head = 0; is_begun = false }
       atomic { oldest = now; now = 0 }
#endif
    od
  } unless { kill_receiver };
  d_step { /* its mappings are gone */
    now = 0;
    do
    :: now < GENERATIONS * POOL -> readers[now] = 0; now++
    :: else -> break
    od;
    now = 0
  }
  receiver_dead = true
}

proctype Supervisor() {
  byte publisher_ends, receiver_ends, next;
  do
  :: publisher_ends < PUBLISHER_ENDS ->
     publisher_ends++;
     kill_publisher = true;
     publisher_dead;
     publisher_now = 0;
     next = publisher_last + 1;
#ifndef BUG_USED_AT_ONCE
     if
     :: next > GENERATIONS -> oldest > next - GENERATIONS
     :: else
     fi;
#endif
     atomic {
       kill_publisher = false; publisher_dead = false;
       publisher_last = next;
       run Publisher(next)
     }
     publisher_now = next;
     next = 0
  :: receiver_ends < RECEIVER_ENDS ->
     receiver_ends++;
#ifdef BUG_ANNOUNCED_EARLY
     receiver_now = 0;
     kill_receiver = true;
     receiver_dead;
#else
     kill_receiver = true;
     receiver_dead;
     receiver_now = 0;
#endif
     atomic { kill_receiver = false; receiver_dead = false; run Receiver(receiver_ends + 1) }
     receiver_now = receiver_ends + 1
  :: break
  od;
  is_over = true
}

init {
  byte i;
  atomic {
    do
    :: i < RING -> returns[i] = NONE; i++
    :: else -> break
    od;
    publisher_last = 1; publisher_now = 1; receiver_now = 1;
    run Publisher(1);
    run Receiver(1);
    run Supervisor();
    i = 0
  }
  timeout -> assert(is_over && is_empty)
}
