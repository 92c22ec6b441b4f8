#pragma once

// All that a component author includes.
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "fastcycle/synchronizer.h"
