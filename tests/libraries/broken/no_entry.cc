// A build note, and no entry function.

#include "note.h"

BROKEN_NOTE(FASTCYCLE_BUILD_NOTE)
