#pragma once

#include <cstddef>
#include <cstdint>

#include <google/protobuf/message.h>
#include <google/protobuf/repeated_field.h>

#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// How much of large fields is copied.
struct ElisionLimits {
  std::size_t elements = 16;  ///< Of a repeated field.
  std::size_t bytes = 64;     ///< Of bytes and strings; a string is cut between two letters.
  std::size_t fields = 4096;  ///< Of the whole message, elements included.
};

/// Copies `from` into `to`, which is of the same type, without the large parts of large fields: its
/// cost does not depend on their size. Adds what was left out to `elisions`.
///
/// @threads  Compatible; `from` is only read.
void copy_elided(const google::protobuf::Message& from, google::protobuf::Message& to,
                 const ElisionLimits& limits,
                 google::protobuf::RepeatedPtrField<protocol::Elision>& elisions);

}  // namespace fastcycle::inspect
