// Sets flush-to-zero for the thread that loads it: -ffast-math does so by the start files of the
// compiler, where they still do, and this says it again.

#include <limits>

#include <fastcycle/fastcycle.h>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace {

bool keeps_small_numbers() {
  const volatile double smallest = std::numeric_limits<double>::min();
  const volatile double half = smallest / 2;
  // Bits, because a comparison takes a denormal for zero as well.
  const double value = half;
  return __builtin_bit_cast(unsigned long long, value) != 0;
}

const bool kKeptThemWhileLoading = [] {
#if defined(__SSE2__)
  constexpr unsigned int kFlushToZero = 0x8040;
  _mm_setcsr(_mm_getcsr() | kFlushToZero);
#endif
  return keeps_small_numbers();
}();

class FastMath final : public fastcycle::Component {
 public:
  explicit FastMath(fastcycle::Context& context) : Component(context) {}

  void stop() override { report("kept_while_loading", kKeptThemWhileLoading); }
};

}  // namespace

FASTCYCLE_COMPONENT(FastMath)
