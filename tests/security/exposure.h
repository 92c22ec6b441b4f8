#pragma once

#include <set>
#include <string>

#include <sys/types.h>

namespace fastcycle::test {

/// The sockets that the process `pid` has open, as the system's tables describe them ("tcp listens
/// at 0100007F:1F90"). The caller must be allowed to see its files.
std::set<std::string> sockets_of(pid_t pid);

/// What of /dev/shm, of System V and of POSIX message queues belongs to the user `uid`.
std::set<std::string> shared_memory_of(uid_t uid);

/// The files that `pid` has mapped from /dev/shm, or that are mapped as shared memory of System V.
std::set<std::string> shared_mappings_of(pid_t pid);

}  // namespace fastcycle::test
