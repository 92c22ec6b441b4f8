#include "fastcycle/assert.h"

#include <cstdio>
#include <cstdlib>

namespace fastcycle::detail {

void assertion_failed(const char* condition, const char* rule, const char* file,
                      int line) noexcept {
  std::fprintf(stderr, "fastcycle: broken contract: %s (%s, %s:%d)\n", rule, condition, file, line);
  std::fflush(stderr);
  std::abort();
}

void contract_broken(const char* what) noexcept {
  std::fprintf(stderr, "fastcycle: broken contract: %s\n", what);
  std::fflush(stderr);
  std::abort();
}

}  // namespace fastcycle::detail
