/*
 * The last activations of a worker, read while it goes on writing.
 *
 * Mirrors  ActivationRing::begin, end, read, read_at (src/executor/activation_ring.cc).
 * Leaves out  all fields but two of those that `begin` writes, and one of those that `end` writes.
 *          Weak memory: what is released is seen in its order here; the seeded bugs let a store
 *          be seen before the one that it must follow, as a relaxed one may be.
 * Checks   a reader takes no record that is made of two; and it says that a record is lost only
 *          if that was written over.
 *
 * run short: two slots         -DRECORDS=4
 * run short: one slot          -DRECORDS=3 -DSLOTS=1
 * run long: three slots        -DRECORDS=8 -DSLOTS=3
 * bug BUG_NEXT_EARLY: the number of records is seen before the last record is   -DRECORDS=2
 * bug BUG_NO_ODD_VERSION: a slot does not say that it is being written          -DRECORDS=4
 * bug BUG_FIELD_EARLY: a field is seen before the version that it belongs to    -DRECORDS=4
 * bug BUG_END_EARLY: what the end of a record writes is seen before its begin   -DRECORDS=4
 * bug BUG_ONE_LOOK: the reader does not look at the version again               -DRECORDS=4
 */
#ifndef RECORDS
#define RECORDS 2
#endif
#ifndef SLOTS
#define SLOTS 2
#endif

#define NONE 255

byte next = 0;
byte version[SLOTS], number[SLOTS], key[SLOTS];
byte duration[SLOTS]; /* of whom it is that of; NONE while it runs */
byte begun = 0;       /* observed: records that were begun */

proctype Writer() {
  byte place;
  do
  :: place < RECORDS ->
#ifdef BUG_NEXT_EARLY
     next = place + 1;
#endif
#ifdef BUG_FIELD_EARLY
     number[place % SLOTS] = place;
#endif
#ifdef BUG_END_EARLY
     duration[place % SLOTS] = place;
#endif
     begun = place + 1;
#ifndef BUG_NO_ODD_VERSION
     version[place % SLOTS] = 2 * place + 1;
#endif
     number[place % SLOTS] = place;
     key[place % SLOTS] = place;
     duration[place % SLOTS] = NONE;
     version[place % SLOTS] = 2 * place + 2;
#ifndef BUG_NEXT_EARLY
     next = place + 1;
#endif
     duration[place % SLOTS] = place; /* ActivationRing::end */
     place++
  :: else -> break
  od
}

proctype Reader() {
  byte end, place, its_number, its_key, its_duration;
  bool is_there;
end_reading:
  do
  :: next > place ->
     end = next;
     do
     :: place < end ->
        is_there = version[place % SLOTS] == 2 * place + 2;
        if
        :: is_there ->
           its_number = number[place % SLOTS];
           its_key = key[place % SLOTS];
           its_duration = duration[place % SLOTS];
#ifndef BUG_ONE_LOOK
           is_there = version[place % SLOTS] == 2 * place + 2
#endif
        :: else
        fi;
        if
        :: is_there ->
           assert(its_number == place && its_key == place);
           assert(its_duration == place || its_duration == NONE)
        :: else -> assert(begun > place + SLOTS) /* it was written over, or is just being */
        fi;
        atomic { place++; its_number = 0; its_key = 0; its_duration = 0; is_there = false }
     :: else -> break
     od
  od
}

init {
  atomic {
    run Writer();
    run Reader()
  }
}
