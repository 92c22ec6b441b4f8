#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "mcap/records.h"

namespace google::protobuf {
class Descriptor;
class DescriptorPool;
class DynamicMessageFactory;
class Message;
}  // namespace google::protobuf

namespace fastcycle::archive {

/// A protobuf message type described by a schema of a file; independent of compiled-in types.
///
/// @threads  Confined.
class MessageType {
 public:
  /// Limit for the estimated size of an unpacked message: a few bytes of a hostile file can expand
  /// to many.
  static constexpr std::uint64_t kMostUnpackedBytes = std::uint64_t{512} << 20U;

  /// @errors  `std::runtime_error` with what is wrong in the schema.
  explicit MessageType(const mcap::Schema& schema);
  MessageType(const MessageType&) = delete;
  MessageType& operator=(const MessageType&) = delete;
  ~MessageType();

  [[nodiscard]] const google::protobuf::Descriptor& descriptor() const { return *descriptor_; }

  /// What is wrong with `data` as a message of this type; none if it can be parsed. Allocates
  /// nothing.
  [[nodiscard]] std::optional<std::string> find_wrong(mcap::Bytes data) const;

  /// The message, valid as long as this. One of proto2 may lack required fields.
  ///
  /// @errors  `std::runtime_error` with the result of `find_wrong`.
  [[nodiscard]] std::unique_ptr<google::protobuf::Message> parse(mcap::Bytes data) const;

  /// The message in protobuf's JSON, valid as long as this.
  ///
  /// @errors  `std::runtime_error` with what is wrong: no JSON, an unknown field, a value of
  ///          another kind.
  [[nodiscard]] std::unique_ptr<google::protobuf::Message> parse_json(std::string_view json) const;

 private:
  std::unique_ptr<google::protobuf::DescriptorPool> pool_;
  std::unique_ptr<google::protobuf::DynamicMessageFactory> factory_;
  const google::protobuf::Descriptor* descriptor_ = nullptr;
};

/// The message types of a file, each created on first use.
///
/// Memory: what the schemas describe; all schemas together are limited to 32 MiB.
///
/// @threads  Confined.
class MessageTypes {
 public:
  struct Found {
    const MessageType* type = nullptr;  ///< Null if there is none, for the reason in `problem`.
    std::string problem = {};
  };

  /// The type that `schema` describes. Valid as long as this.
  const Found& find(const mcap::Schema& schema);

 private:
  struct Known {
    std::unique_ptr<MessageType> type;
    Found found;
  };

  std::map<std::uint16_t, Known> known_;
  std::uint64_t schema_bytes_ = 0;
};

}  // namespace fastcycle::archive
