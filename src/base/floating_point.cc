#include "base/floating_point.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif
#include <cfenv>

namespace fastcycle::base {

void reset_floating_point() noexcept {
#if defined(__SSE2__)
  constexpr unsigned int kDefaultControl = 0x1f80;  // Intel SDM, MXCSR after reset.
  if (_mm_getcsr() != kDefaultControl) {
    _mm_setcsr(kDefaultControl);
  }
#elif defined(__aarch64__)
  __builtin_aarch64_set_fpcr(0);
#else
  std::fesetenv(FE_DFL_ENV);
#endif
}

}  // namespace fastcycle::base
