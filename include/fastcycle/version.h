#pragma once

#include <google/protobuf/port_def.inc>
#include <google/protobuf/port_undef.inc>
#include <google/protobuf/stubs/common.h>

#define FASTCYCLE_VERSION_MAJOR 0
#define FASTCYCLE_VERSION_MINOR 1
#define FASTCYCLE_VERSION_PATCH 0
#define FASTCYCLE_VERSION "0.1.0"

#define FASTCYCLE_TEXT_OF_(x) #x
#define FASTCYCLE_TEXT_OF(x) FASTCYCLE_TEXT_OF_(x)

#if defined(FASTCYCLE_SANITIZER)
// Defined by the build: a component with a sanitizer for a host without one, which loads the
// sanitizer's library first.
#elif defined(__SANITIZE_ADDRESS__)
#define FASTCYCLE_SANITIZER "address"
#elif defined(__SANITIZE_THREAD__)
#define FASTCYCLE_SANITIZER "thread"
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define FASTCYCLE_SANITIZER "address"
#elif __has_feature(thread_sanitizer)
#define FASTCYCLE_SANITIZER "thread"
#endif
#endif
#if !defined(FASTCYCLE_SANITIZER)
#define FASTCYCLE_SANITIZER "none"
#endif

/// Properties that must be equal in host and component library: the core's version (its major and
/// minor number), the ABI of the standard library, protobuf's version, the sanitizer.
#define FASTCYCLE_BUILD_NOTE \
  "fastcycle=" FASTCYCLE_TEXT_OF(FASTCYCLE_VERSION_MAJOR) "." FASTCYCLE_TEXT_OF(   \
      FASTCYCLE_VERSION_MINOR) " libstdc++=" FASTCYCLE_TEXT_OF(                    \
      _GLIBCXX_USE_CXX11_ABI) " protobuf=" FASTCYCLE_TEXT_OF(GOOGLE_PROTOBUF_VERSION) " sanitizer=" FASTCYCLE_SANITIZER
