#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "broker/read_ring.h"
#include "component/application_host.h"
#include "executor/activation_ring.h"

namespace google::protobuf {
class Message;
}

namespace fastcycle::detail {

class ComponentCore;

/// A key frame: the activation at whose end it was written, and the reads of that, which contain
/// all that FastCycle keeps for a component (see `DeclaredStates`).
struct KeyFrame {
  std::uint64_t activation = 0;
  std::span<const ReplayedReads::Entry> reads;
  /// The message of a state, by a read of the kind `kKeyFrame`.
  std::function<const google::protobuf::Message&(const Read& read)> state;
};

/// Restores a component to a key frame: its object is reconstructed and started, with the state and
/// the params of the frame. What it publishes meanwhile must not be delivered; the messages in its
/// views, and the sequences of its publishers, are left to the caller. Between its activations.
void begin_at_key_frame(host::ApplicationHost& application, ComponentCore& core,
                        ActivationRing& ring, ReplayedReads& replayed, const KeyFrame& frame);

}  // namespace fastcycle::detail
