#include <fastcycle/fastcycle.h>

#include "perception.h"

// Apart from the class, so that another library can be made of it.
FASTCYCLE_COMPONENT(ads::Perception)
