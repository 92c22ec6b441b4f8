#pragma once

namespace fastcycle {

/// While it exists, `new` on its thread allocates from the memory that other processes of the
/// application may read: for strings, fields and sub-messages of a message that is filled.
///
/// A loan opens one for the thread that borrowed it. A thread that fills a message borrowed by
/// another thread needs its own; else `publish` copies what it added. It does nothing if no other
/// process reads the messages of the component.
///
///     std::thread filler([&loan] {
///       const fastcycle::LoanScope scope;
///       loan->mutable_points()->resize(100'000);
///     });
///
/// @threads  Confined to its thread; scopes may be nested.
/// @realtime 5 ns.
class LoanScope {
 public:
  LoanScope() noexcept;
  LoanScope(const LoanScope&) = delete;
  LoanScope& operator=(const LoanScope&) = delete;
  ~LoanScope();
};

}  // namespace fastcycle
