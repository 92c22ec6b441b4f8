#pragma once

// All that a component author includes.
#include "fastcycle/action.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "fastcycle/service.h"
#include "fastcycle/synchronizer.h"
