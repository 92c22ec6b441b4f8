#pragma once

#include <cstdint>
#include <map>
#include <string>

#include <sys/types.h>

namespace fastcycle::test {

/// What an attack came to.
enum class Result : char {
  kRefused = 'r',    ///< The kernel refused it.
  kSucceeded = 's',  ///< The attacker got what it wanted.
  kMissing = 'm',    ///< This kernel has no such thing.
  kFailed = 'f',     ///< Neither: it was allowed, and brought nothing.
};

/// All that a process of the same user can try against the process `victim`, which has the text
/// `secret` at `address`: by name of the attack, what came of it. The victim must be a child of the
/// caller: some systems allow nobody else to look into it.
std::map<std::string, Result> attack(pid_t victim, std::uintptr_t address,
                                     const std::string& secret);

// To hand the results from one process to another.
std::string to_text(const std::map<std::string, Result>& results);
std::map<std::string, Result> from_text(const std::string& text);

}  // namespace fastcycle::test
