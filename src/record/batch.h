#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "fastcycle/detail/envelope.h"
#include "log/log.pb.h"
#include "mcap/chunk_builder.h"
#include "record/serializer.h"
#include "record/stored_message.h"

namespace fastcycle::record {

/// Messages for one chunk of the file: either small ones, copied, or a single large one, which is
/// held until it is written.
///
/// @threads  Confined; handed from the thread that fills it to the one that writes it.
class Batch {
 public:
  /// Messages of one topic, and their bytes, serialized.
  struct Count {
    std::size_t topic;
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
  };

  explicit Batch(const mcap::ChunkOptions& options) : chunk(options) {}
  Batch(const Batch&) = delete;
  Batch& operator=(const Batch&) = delete;
  ~Batch() { release(); }

  /// Takes over the reference to `envelope`, whose bytes the chunk borrows; decrements `count` when
  /// it is released.
  void hold(detail::Envelope* envelope, std::atomic<std::size_t>& count) noexcept {
    held_ = envelope;
    count_ = &count;
  }

  /// Releases the held message. The chunk must be cleared before it is used again.
  void release() noexcept {
    if (held_ != nullptr) {
      detail::release(std::exchange(held_, nullptr));
      count_->fetch_sub(1, std::memory_order_release);
    }
  }

  log::Activations& activations_of(std::size_t worker) {
    while (activations.size() <= worker) {
      activations.emplace_back().set_worker(static_cast<std::uint32_t>(activations.size() - 1));
    }
    return activations[worker];
  }

  mcap::ChunkBuilder chunk;
  Serializer serializer;  ///< Of the borrowed message.
  log::MessageInfos infos;
  std::vector<log::Activations> activations;  ///< By worker.
  std::vector<StoredMessage> latched;         ///< Those of latched topics.
  std::vector<Count> counts;
  std::int64_t began_ns = 0;  ///< CLOCK_MONOTONIC of the first message.

 private:
  detail::Envelope* held_ = nullptr;
  std::atomic<std::size_t>* count_ = nullptr;
};

}  // namespace fastcycle::record
