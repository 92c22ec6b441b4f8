#pragma once

namespace fastcycle {

/// While one lives, what its thread allocates with `new` lies in the memory that other processes of
/// the application may read: strings, fields and sub-messages of a message that is filled.
///
/// A loan opens one by itself, for the thread that borrowed. A thread that fills a message which
/// another thread borrowed needs its own; else `publish` copies what it added. In a program, or a
/// component, whose messages nobody reads in another process it does nothing.
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
