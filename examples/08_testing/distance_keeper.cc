#include "distance_keeper.h"

FASTCYCLE_COMPONENT(DistanceKeeper)
