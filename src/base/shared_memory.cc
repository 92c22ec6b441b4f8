#include "base/shared_memory.h"

#include "fastcycle/loan_scope.h"

namespace fastcycle {

namespace base {

SharedMemory shared_memory;
thread_local constinit unsigned shared_scopes = 0;

}  // namespace base

LoanScope::LoanScope() noexcept {
  base::enter_shared_scope();
}

LoanScope::~LoanScope() {
  base::leave_shared_scope();
}

}  // namespace fastcycle
