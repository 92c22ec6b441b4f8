#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <google/protobuf/io/zero_copy_stream.h>

#include "mcap/records.h"

namespace google::protobuf {
class Message;
}

namespace fastcycle::record {

/// Serializes messages without copying their large fields: a camera image stays in place, and only
/// the few bytes around it are written.
///
/// @threads  Confined.
class Serializer {
 public:
  /// Limit of protobuf.
  static constexpr std::uint64_t kBytesMax = std::numeric_limits<std::int32_t>::max();

  /// The bytes of `message`, to be concatenated; valid until the next call, and as long as
  /// `message` is unchanged.
  ///
  /// @errors  `std::length_error` for a message of 2 GiB or more, which protobuf cannot hold.
  [[nodiscard]] std::span<const mcap::Bytes> serialize(const google::protobuf::Message& message);

  /// The same, in one string.
  [[nodiscard]] std::string serialize_to_string(const google::protobuf::Message& message);

  /// Size of the last result of `serialize`, in bytes.
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  /// The output stream for protobuf: own memory for small data, and references to the message's
  /// own.
  class Parts final : public google::protobuf::io::ZeroCopyOutputStream {
   public:
    void clear();
    void gather(std::vector<mcap::Bytes>& parts) const;

    bool Next(void** data, int* size) override;
    void BackUp(int count) override;
    [[nodiscard]] std::int64_t ByteCount() const override {
      return static_cast<std::int64_t>(borrowed_size_ + own_.size());
    }
    bool WriteAliasedRaw(const void* data, int size) override;
    [[nodiscard]] bool AllowsAliasing() const override { return true; }

   private:
    static constexpr std::size_t kBlock = 512;

    /// Borrowed bytes, inserted after `after` bytes of `own_`.
    struct Run {
      std::size_t after = 0;
      mcap::Bytes bytes;
    };

    std::vector<std::byte> own_;
    std::vector<Run> runs_;
    std::size_t borrowed_size_ = 0;
  };

  Parts stream_;
  std::vector<mcap::Bytes> parts_;
  std::uint64_t size_ = 0;
};

}  // namespace fastcycle::record
