/*
 * One publisher in two processes, of which the second takes the place of the first: what its receivers get.
 *
 * Mirrors  pushing to the links in their order (PublisherCore::put_into_lanes), publishing again what may not
 *          have reached all (send_following, stop_following), handing on what the other process published
 *          (put_followed), dropping by sequence (publish_imported), and the receiving end of two links of one
 *          publisher (Import::take and attach, LinkSet::take).
 * Leaves out  the ring of activations, of which only remains which sequences were executed (takeover.pml), full
 *          queues (remote_lane.pml), waking (process_bell.pml), the restart of a process and who holds messages of
 *          the one that ended (process_generations.pml).
 * Checks   each receiver gets each sequence once, in order, none missing and with the right content, also one in
 *          the process on standby itself; nobody waits for ever.
 *
 * Process ACTIVE publishes first, the other one follows it. An activation publishes EACH messages, which have
 * consecutive sequences. It is begun, then its messages are pushed to one link after the other, then it is ended.
 * The follower executes what was ended, and gives it to nobody. ENDS processes are killed, one after the other, each
 * at any step. The second one takes the place of the first when that one has ended, and its supervisor says so at any
 * time after that. Without an end of the second one all messages come; else those that were pushed.
 *
 * The links of each process are in this order: RECEIVERS of them to others, one to the partner, the rest to others;
 * the partner's is at PARTNER_AT. A receiver looks at the links of process 0 first, whoever was active first.
 *
 * run long: two receivers, the first one ends  -DMESSAGES=2
 * run short: one receiver, the second one in the plan is active first  -DMESSAGES=3 -DRECEIVERS=1 -DACTIVE=1
 * run long: one receiver, four messages       -DMESSAGES=4 -DRECEIVERS=1
 * run short: two messages in each activation   -DMESSAGES=4 -DEACH=2 -DRECEIVERS=1 -DPARTNER_AT=0
 * run short: both end                          -DMESSAGES=2 -DRECEIVERS=1 -DENDS=2
 * run short: both end, the other order         -DMESSAGES=2 -DRECEIVERS=1 -DENDS=2 -DACTIVE=1
 * run long: two receivers, the other order     -DMESSAGES=2 -DACTIVE=1
 * run long: two receivers, the partner gets everything first  -DMESSAGES=2 -DPARTNER_AT=0
 * run long: two receivers, the partner gets everything last  -DMESSAGES=2 -DPARTNER_AT=2
 * run long: two receivers, three messages      -DMESSAGES=3
 * run long: two receivers, two messages in each activation  -DMESSAGES=4 -DEACH=2 -DPARTNER_AT=2
 * run long: two receivers, both end            -DMESSAGES=2 -DENDS=2 -DACTIVE=1
 * bug BUG_PARTNER_NOT_TAKEN: what the other process left in its link is not taken first     -DMESSAGES=3 -DRECEIVERS=1 -DACTIVE=1
 * bug BUG_PARTNER_ALWAYS_FIRST: the other link is taken first, also where it has the newer ones  -DMESSAGES=3 -DRECEIVERS=1
 * bug BUG_DRAINED_ALONE: the link of who has ended is read to its end without the other one  -DMESSAGES=3 -DRECEIVERS=1 -DENDS=2 -DACTIVE=1
 * bug BUG_PARTNER_SEEN_FIRST: the other link is looked at before one's own                  -DMESSAGES=3 -DRECEIVERS=1
 * bug BUG_NOT_DROPPED: a sequence that was there before is not dropped                      -DMESSAGES=2
 * bug BUG_ONLY_WHAT_IS_NEW: published again is only what did not reach the process itself   -DMESSAGES=2 -DPARTNER_AT=0
 * bug BUG_NOTHING_AGAIN: what was begun and not ended counts as published                   -DMESSAGES=2
 * bug BUG_OWN_NUMBERS: what is published again gets new sequences                           -DMESSAGES=2
 * bug BUG_GIVEN_AGAIN: what came from the other process is given to its own receivers again -DMESSAGES=2
 * bug BUG_NOT_HANDED_ON: what comes from the other process is only compared                 -DMESSAGES=2
 * bug BUG_REST_LEFT: the rest in the link to itself is not taken before it publishes        -DMESSAGES=2 -DRECEIVERS=1
 * bug BUG_ENDED_EARLY: an activation is ended before all links have its messages            -DMESSAGES=2
 */
#ifndef RECEIVERS
#define RECEIVERS 2
#endif
#ifndef EACH
#define EACH 1
#endif
#ifndef ENDS
#define ENDS 1
#endif
#ifndef ACTIVE
#define ACTIVE 0
#endif
#ifndef PARTNER_AT
#define PARTNER_AT 1
#endif
#define LAST MESSAGES
#define LINKS (RECEIVERS + 1)
#define TO_PARTNER RECEIVERS
#define STANDBY (1 - ACTIVE)
#define AT(process, link) ((process) * LINKS + (link))

/* A link: which sequences were pushed, from `first` to `tail`, as they are consecutive. 0: none yet. */
byte first[2 * LINKS], tail[2 * LINKS];
byte value[2 * (LAST + EACH + 1)]; /* of each sequence, by process */
#define VALUE(process, sequence) value[(process) * (LAST + EACH + 1) + (sequence)]

/* The activation ring of the active one: the last sequence of what was begun, and of what was ended. */
byte begun = 0, ended = 0;

bool is_killed[2], has_ended[2]; /* has_ended: all workers, told by the kernel */
bool is_here[2];                 /* told by the supervisor */
byte changes = 0;

/* What is observed. */
byte local_last = 0; /* the receiver in the process on standby */
byte got[RECEIVERS];
bool is_public = false;

/* Pushes sequence `what` into link `to`. */
inline push(process, to, what) {
  d_step {
    assert(tail[AT(process, to)] == 0 || tail[AT(process, to)] == (what) - 1);
    if
    :: first[AT(process, to)] == 0 -> first[AT(process, to)] = what
    :: else
    fi;
    tail[AT(process, to)] = what
  }
}

/* To all links of the process, in their order. */
inline push_to_all(process, what) {
  do
  :: place < LINKS ->
     atomic {
       if
       :: place == PARTNER_AT -> push(process, TO_PARTNER, what)
       :: place < PARTNER_AT -> push(process, place, what)
       :: place > PARTNER_AT -> push(process, place - 1, what)
       fi;
       place++
     }
  :: atomic { place == LINKS -> place = 0; break }
  od
}

proctype Active() {
  byte sequence = 1, place, i;
  {
    do
    :: atomic { begun < LAST -> begun = begun + EACH }
       do
       :: atomic { i < EACH -> VALUE(ACTIVE, sequence) = sequence; i++ }
#ifdef BUG_ENDED_EARLY
          ended = begun;
#endif
          push_to_all(ACTIVE, sequence);
          sequence++
       :: atomic { i == EACH -> i = 0; break }
       od;
#ifndef BUG_ENDED_EARLY
       ended = begun
#endif
    :: begun == LAST -> break
    od;
end_active:
    false
  } unless { is_killed[ACTIVE] };
  has_ended[ACTIVE] = true
}

/* The receiver in the process on standby: its lane. */
inline give_local(what) {
  d_step {
    assert((what) == local_last + 1);
    local_last = what
  }
}

/* Takes from the partner's link what is there. */
inline take_partner() {
  do
  :: atomic {
       tail[AT(ACTIVE, TO_PARTNER)] > head ->
       head++;
       if
#ifdef BUG_NOT_DROPPED
       :: true ->
#else
       :: head > published ->
#endif
          published = head;
#ifndef BUG_NOT_HANDED_ON
          give_local(head)
#endif
       :: else
       fi
     }
  :: tail[AT(ACTIVE, TO_PARTNER)] == head -> break
  od
}

proctype Standby() {
  byte made = 0, published = 0, head = 0, place;
#ifdef BUG_OWN_NUMBERS
  byte executed;
#endif
  {
end_following:
    do
    :: !has_ended[ACTIVE] && tail[AT(ACTIVE, TO_PARTNER)] > head -> take_partner()
    :: !has_ended[ACTIVE] && made < ended -> made = made + EACH /* executed; what it publishes goes nowhere */
    :: has_ended[ACTIVE] -> break
    od;
#ifndef BUG_REST_LEFT
    take_partner();
#endif
    is_public = true;
#ifdef BUG_NOTHING_AGAIN
    made = begun;
#endif
#ifdef BUG_OWN_NUMBERS
    executed = made;
    made = published;
#endif
    do
#ifdef BUG_OWN_NUMBERS
    :: atomic {
         executed < LAST ->
         executed++;
         made++;
         VALUE(STANDBY, made) = executed;
#else
    :: atomic {
         made < LAST ->
         made++;
         VALUE(STANDBY, made) = made;
#endif
         if
         :: made > published -> published = made; give_local(made)
#ifdef BUG_GIVEN_AGAIN
         :: else -> give_local(made)
#else
         :: else
#endif
         fi
       }
#ifdef BUG_ONLY_WHAT_IS_NEW
       if
       :: VALUE(ACTIVE, made) == 0 || made > head -> push_to_all(STANDBY, made)
       :: else
       fi
#else
       push_to_all(STANDBY, made)
#endif
    :: else -> break
    od;
#ifdef BUG_REST_LEFT
    take_partner();
#endif
    assert(local_last == LAST);
end_standby:
    false
  } unless { is_killed[STANDBY] };
  has_ended[STANDBY] = true
}

/* The supervisor, and who kills. */
proctype Supervisor() {
  if
  :: is_killed[ACTIVE] = true;
     has_ended[ACTIVE];
#if ENDS > 1
     if
     :: is_public -> is_killed[STANDBY] = true
     :: true
     fi;
#endif
     d_step { is_here[ACTIVE] = false; changes++ };
#if ENDS > 1
     if
     :: is_killed[STANDBY] ->
        has_ended[STANDBY];
        d_step { is_here[STANDBY] = false; changes++ }
     :: is_public && !is_killed[STANDBY] ->
        is_killed[STANDBY] = true;
        has_ended[STANDBY];
        d_step { is_here[STANDBY] = false; changes++ }
     :: true
     fi
#endif
  :: true
  fi
}

/* The sequence at the head of this link; 0: it has none. */
#define HEAD(link) (tail[AT(link, self)] == 0 || next[link] > tail[AT(link, self)] -> 0 : \
                    (next[link] == 0 -> first[AT(link, self)] : next[link]))

/* All that a link has now. */
inline take_all(link) {
    do
    :: HEAD(link) != 0 ->
       sequence = HEAD(link);
       next[link] = sequence + 1;
       if
#ifdef BUG_NOT_DROPPED
       :: true ->
#else
       :: sequence > got[self] ->
#endif
          assert(sequence == got[self] + 1);
          assert(VALUE(link, sequence) == sequence);
          got[self] = sequence
       :: else
       fi;
       sequence = 0
    :: else -> break
    od
}

/* Of two links of one publisher: the older messages first. */
inline take(link) {
#ifdef BUG_PARTNER_SEEN_FIRST
  theirs = HEAD(1 - link);
  own = HEAD(link);
#else
  own = HEAD(link);
  theirs = HEAD(1 - link);
#endif
  atomic {
  if
#ifdef BUG_PARTNER_NOT_TAKEN
  :: false
#elif defined(BUG_PARTNER_ALWAYS_FIRST)
  :: own != 0 && theirs != 0 -> take_all(1 - link)
#else
  :: own != 0 && theirs != 0 && theirs < own -> take_all(1 - link)
#endif
  :: else
  fi;
  if
  :: own != 0 -> take_all(link)
  :: else
  fi;
  own = 0;
  theirs = 0
  }
}

/* Looks who there is: what one that has ended left is taken. */
inline attach(link) {
  if
  :: is_known[link] && !is_here[link] ->
#ifdef BUG_DRAINED_ALONE
     atomic { take_all(link) };
#else
     take(link);
#endif
     is_known[link] = false
  :: else
  fi
}

proctype Receiver(byte self) {
  byte next[2], sequence, own, theirs, seen;
  bool is_known[2];
  atomic { is_known[0] = true; is_known[1] = true }
end_receiving:
  do
  :: atomic { changes != seen -> seen = changes }
     attach(0);
     attach(1)
  :: HEAD(0) != 0 || HEAD(1) != 0 -> /* of who has ended all was taken */
     take(0);
     take(1)
  od
}

init {
  byte i;
  atomic {
    is_here[0] = true;
    is_here[1] = true;
    run Active();
    run Standby();
    run Supervisor();
    do
    :: i < RECEIVERS -> run Receiver(i); i++
    :: else -> break
    od;
    i = 0
  }
  timeout -> d_step {
    do
    :: i < RECEIVERS ->
       assert(is_killed[STANDBY] || got[i] == LAST);
       assert(is_killed[STANDBY] || local_last == LAST);
       i++
    :: else -> break
    od;
    i = 0
  }
}
