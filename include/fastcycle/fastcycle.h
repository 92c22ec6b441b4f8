#pragma once

// Includes everything that component authors need.
#include "fastcycle/action.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "fastcycle/service.h"
#include "fastcycle/synchronizer.h"
