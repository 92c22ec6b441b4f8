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

/// A protobuf message type as a schema of a file describes it; nothing that is compiled in is used.
///
/// @threads  Confined.
class MessageType {
 public:
  /// More than this a message may not take when it is unpacked, estimated: a few bytes of a hostile
  /// file can stand for many.
  static constexpr std::uint64_t kMostUnpackedBytes = std::uint64_t{512} << 20U;

  /// @errors  `std::runtime_error` that says what of the schema is wrong.
  explicit MessageType(const mcap::Schema& schema);
  MessageType(const MessageType&) = delete;
  MessageType& operator=(const MessageType&) = delete;
  ~MessageType();

  [[nodiscard]] const google::protobuf::Descriptor& descriptor() const { return *descriptor_; }

  /// What is wrong with `data` as a message of this type; none if it can be parsed. Asks for no
  /// memory.
  [[nodiscard]] std::optional<std::string> find_wrong(mcap::Bytes data) const;

  /// The message, valid as long as this. One of proto2 may lack required fields.
  ///
  /// @errors  `std::runtime_error` with what `find_wrong` says.
  [[nodiscard]] std::unique_ptr<google::protobuf::Message> parse(mcap::Bytes data) const;

  /// The message that protobuf's JSON says, valid as long as this.
  ///
  /// @errors  `std::runtime_error` with what is wrong: no JSON, a field that there is not, a value
  ///          of another kind.
  [[nodiscard]] std::unique_ptr<google::protobuf::Message> parse_json(std::string_view json) const;

 private:
  std::unique_ptr<google::protobuf::DescriptorPool> pool_;
  std::unique_ptr<google::protobuf::DynamicMessageFactory> factory_;
  const google::protobuf::Descriptor* descriptor_ = nullptr;
};

/// The message types of a file, each made when it is asked for the first time.
///
/// Memory: what the schemas describe; of all schemas together, 32 MiB are taken at most.
///
/// @threads  Confined.
class MessageTypes {
 public:
  struct Found {
    const MessageType* type = nullptr;  ///< Null if `problem` says why there is none.
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
