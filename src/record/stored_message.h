#pragma once

#include <cstddef>
#include <vector>

#include "mcap/records.h"

namespace fastcycle::record {

/// A message as stored in a file.
struct StoredMessage {
  mcap::MessageHead head;
  std::vector<std::byte> data;
};

}  // namespace fastcycle::record
