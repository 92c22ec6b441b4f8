#include "dds_gateway/gateway.h"

using fastcycle::dds_gateway::Gateway;

FASTCYCLE_COMPONENTS(Gateway);
