/*
 * Processes that serve rounds of simulated time together, of which some end and are restarted.
 *
 * Mirrors  Rounds (src/processes/rounds.cc): a count of the points that a process came to, and what it
 *          said at the last two; the supervisor's words, incarnation and restarting; joining
 *          of a restarted process.
 * Leaves out  messages, sleeping (a wait is a guard), and the start of components of a restarted process,
 *          which nobody else takes part in.
 * Checks   at each point all do the same, an agreement or an exchange, and decide the same; nobody waits for
 *          ever.
 *
 * Process 0 is the main one, which does not end: with it all would. The others end at any step, at most ENDS
 * times each, and are restarted as long as the restarts of RESTARTS last, then not. At an agreement each says
 * whether it has something to do, by chance; if anyone has, an exchange follows.
 *
 * run short: two processes, one end           -DPROCESSES=2 -DENDS=1 -DRESTARTS=1 -DPOINTS=2
 * run short: two processes, gone for good     -DPROCESSES=2 -DENDS=1 -DRESTARTS=0 -DPOINTS=4
 * run short: two ends of one process          -DPROCESSES=2 -DENDS=2 -DRESTARTS=2 -DPOINTS=1 -DMORE=0
 * run long: two processes, one end, more points  -DPROCESSES=2 -DENDS=1 -DRESTARTS=1 -DPOINTS=4
 * run long: two ends of one process, more rounds  -DPROCESSES=2 -DENDS=2 -DRESTARTS=2 -DPOINTS=1
 * run long: two ends of one process, more points  -DPROCESSES=2 -DENDS=2 -DRESTARTS=2 -DPOINTS=3
 * run long: three processes, one ends, more points  -DPROCESSES=3 -DENDS=1 -DRESTARTS=1 -DPOINTS=2 -DONE_ENDS
 * run long: three processes, both end         -DPROCESSES=3 -DENDS=1 -DRESTARTS=1 -DPOINTS=1
 * bug BUG_FORGETS_WHAT_WAS_SAID: what a process said before its end does not count  -DPROCESSES=3 -DENDS=1 -DRESTARTS=0 -DPOINTS=3
 * bug BUG_SAYS_IT_ONCE: what was said last is not said again by the next incarnation  -DPROCESSES=2 -DENDS=2 -DRESTARTS=2 -DPOINTS=3
 * bug BUG_LOOKS_AT_IT_ONCE: a process that came, and ended again, between two looks is gone for good  -DPROCESSES=2 -DENDS=2 -DRESTARTS=2 -DPOINTS=3
 * bug BUG_SAYS_THE_LAST_ONLY: the same of the point before the last  -DPROCESSES=2 -DENDS=2 -DRESTARTS=2 -DPOINTS=3
 * bug BUG_ANNOUNCED_FIRST: the end is announced before the restart is     -DPROCESSES=2 -DENDS=1 -DRESTARTS=1 -DPOINTS=3
 * bug BUG_JOINS_AT_AGREEMENT: a restarted process does not look where the others wait  -DPROCESSES=2 -DENDS=1 -DRESTARTS=1 -DPOINTS=4
 * bug BUG_WAITS_FOR_JOINING: a restarted process waits for others that are restarted too  -DPROCESSES=3 -DENDS=1 -DRESTARTS=1 -DPOINTS=3
 */
#define GENERATIONS 3
#ifndef MORE
#define MORE 2
#endif
#define LAST (POINTS + 2 + MORE)

#define AGREEMENT 1
#define EXCHANGE 2

/* What stands in memory, by process and generation. */
typedef Words {
  byte count;
  bool is_joining;
  byte kind[2];
  bit ready[2];
}
typedef Generations {
  Words at[GENERATIONS];
}
Generations words[PROCESSES];
byte incarnation[PROCESSES];  /* 0: there is none. */
byte restarting[PROCESSES];
bool is_killed[PROCESSES];
bool has_ended[PROCESSES];
byte changes;  /* Of all incarnations. */
bool is_over;  /* The main process has come to its end. */

/* What was decided at each point first; all others must find the same. */
byte kinds[LAST + 2];
byte decided[LAST + 2];  /* 0: nothing yet, 1: no round, 2: a round. */

#define W(p, n) words[p].at[(n) % GENERATIONS]

/* At the next point. */
inline say(what) {
  atomic {
    count++;
    W(me, own).kind[count % 2] = what;
    if
    :: what == AGREEMENT -> W(me, own).ready[count % 2] = 0
    :: what == AGREEMENT -> W(me, own).ready[count % 2] = 1
    :: what == EXCHANGE -> W(me, own).ready[count % 2] = 0
    fi;
    W(me, own).count = count;
    assert(kinds[count] == 0 || kinds[count] == what);
    kinds[count] = what
  }
}

#define CAME(q) (known[q] != 0 && W(q, known[q]).count >= count)
#ifdef BUG_FORGETS_WHAT_WAS_SAID
#define COUNTS(q) (CAME(q) && incarnation[q] == known[q])
#else
#define COUNTS(q) CAME(q)
#endif

/* Adds what process q says at this point; nothing if it has ended before. */
inline await(q, what) {
  do
  :: is_killed[me] -> goto ended
  :: else ->
     seen = changes;
     now = incarnation[q];
     coming = restarting[q];
     atomic {
       if
       :: COUNTS(q) ->  /* What it said before its end was said for all. */
          assert(W(q, known[q]).kind[count % 2] == what);
          any = any | W(q, known[q]).ready[count % 2];
          break
       :: !COUNTS(q) && now != 0 && now != known[q] -> known[q] = now
       :: !COUNTS(q) && now == 0 && coming == 0 ->
          if
#ifdef BUG_LOOKS_AT_IT_ONCE
          :: incarnation[q] == 0 -> break
#else
          :: changes == seen -> break
#endif
          :: else -> skip
          fi
       :: else -> skip
       fi
     };
     /* Sleeps until something changes. */
     (is_killed[me] || COUNTS(q) || incarnation[q] != now || restarting[q] != coming || changes != seen)
  od
}

inline await_all(what) {
  q = 0;
  do
  :: q < PROCESSES && q != me -> await(q, what); q++
  :: q < PROCESSES && q == me -> any = any | W(me, own).ready[count % 2]; q++
  :: else -> break
  od
}

#ifdef BUG_WAITS_FOR_JOINING
#define STANDS(q) (known[q] == 0 || W(q, known[q]).count >= count + 1)
#else
#define STANDS(q) (known[q] == 0 || W(q, known[q]).is_joining || W(q, known[q]).count >= count + 1)
#endif

inline end_if_killed() {
  if
  :: is_killed[me] -> goto ended
  :: else -> skip
  fi
}

proctype Process(byte me; byte own) {
  byte count = 0;
  byte known[PROCESSES];
  byte q = 0;
  byte now = 0;
  byte coming = 0;
  byte seen = 0;
  bit any = 0;
  bool at_exchange = false;
  bool is_joining = false;
  d_step {
    do
    :: q < PROCESSES -> known[q] = 1; q++
    :: else -> break
    od;
    q = 0
  }
  if
  :: own > 1 ->
     atomic {
       count = W(me, own - 1).count;
       now = own - 1;
       if
       :: own > 2 && W(me, own - 2).count > count -> now = own - 2; count = W(me, now).count
       :: else -> skip
       fi;
#ifndef BUG_SAYS_IT_ONCE
       W(me, own).kind[count % 2] = W(me, now).kind[count % 2];
       W(me, own).ready[count % 2] = W(me, now).ready[count % 2];
#ifndef BUG_SAYS_THE_LAST_ONLY
       W(me, own).kind[(count + 1) % 2] = W(me, now).kind[(count + 1) % 2];
       W(me, own).ready[(count + 1) % 2] = W(me, now).ready[(count + 1) % 2];
#endif
#endif
       now = 0;
       is_joining = true;
       W(me, own).is_joining = true;
       W(me, own).count = count
     };
     (incarnation[me] == own || is_killed[me] || is_over);
     end_if_killed();
     /* Joins: waits until all who are there stand. */
     q = 0;
     do
     :: q < PROCESSES && q == me -> q++
     :: q < PROCESSES && q != me ->
        do
        :: is_killed[me] || is_over -> goto ended
        :: else ->
           atomic {
             known[q] = incarnation[q];
             if
             :: STANDS(q) -> break
             :: else -> skip
             fi
           };
           (is_killed[me] || is_over || incarnation[q] != known[q] || STANDS(q))
        od;
        q++
     :: else -> break
     od;
#ifndef BUG_JOINS_AT_AGREEMENT
     at_exchange = (W(0, 1).kind[(count + 1) % 2] == EXCHANGE)
#endif
  :: else -> skip
  fi;
  do
  :: true ->
     end_if_killed();
     if
     :: is_joining -> is_joining = false; W(me, own).is_joining = false
     :: else -> skip
     fi;
     if
     :: at_exchange -> skip
     :: else ->
        any = 0;
        say(AGREEMENT);
        end_if_killed();
        await_all(AGREEMENT);
        atomic {
          assert(decided[count] == 0 || decided[count] == any + 1);
          decided[count] = any + 1
        }
     fi;
     if
     :: at_exchange || decided[count] == 2 ->
        at_exchange = false;
        end_if_killed();
        say(EXCHANGE);
        end_if_killed();
        await_all(EXCHANGE)
     :: else ->
        if
        :: count >= POINTS -> break  /* All leave at the same point. */
        :: else -> skip
        fi
     fi;
     if
     :: count >= LAST - 2 -> break
     :: else -> skip
     fi
  od;
  if
  :: me == 0 -> is_over = true
  :: else -> skip
  fi;
ended:
  has_ended[me] = true
}

inline announce(who, now) {
  incarnation[who] = now;
  changes++
}

/* The supervisor, as far as it has to do with process p. */
proctype Life(byte p) {
  byte n = 1;
  byte ends = ENDS;
  byte left = RESTARTS;
  do
  :: is_over -> break
#ifdef ONE_ENDS
  :: p == 1 && ends > 0 ->
#else
  :: p != 0 && ends > 0 ->
#endif
     ends--;
     is_killed[p] = true;
     has_ended[p];
     if
     :: left > 0 ->
        left--;
#ifdef BUG_ANNOUNCED_FIRST
        announce(p, 0);
        restarting[p] = n + 1;
#else
        restarting[p] = n + 1;
        announce(p, 0);
#endif
        n++;
        atomic {
          is_killed[p] = false;
          has_ended[p] = false;
          W(p, n).count = 0;
          W(p, n).is_joining = false;
          run Process(p, n)
        };
        (W(p, n).is_joining);  /* It is built. */
        announce(p, n);
        restarting[p] = 0
     :: else ->
        announce(p, 0);
        break
     fi
  od
}

init {
  byte p = 0;
  atomic {
    do
    :: p < PROCESSES -> incarnation[p] = 1; run Process(p, 1); run Life(p); p++
    :: else -> break
    od
  }
}
