#include "record/serializer.h"

#include <stdexcept>

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/message.h>

#include "broker/serialized.h"

namespace fastcycle::record {

void Serializer::Parts::clear() {
  own_.clear();
  runs_.clear();
  borrowed_size_ = 0;
}

void Serializer::Parts::gather(std::vector<mcap::Bytes>& parts) const {
  const mcap::Bytes own(own_);
  std::size_t begin = 0;
  const auto add_own = [&](std::size_t end) {
    if (end > begin) {
      parts.push_back(own.subspan(begin, end - begin));
    }
    begin = end;
  };
  for (const Run& run : runs_) {
    add_own(run.after);
    parts.push_back(run.bytes);
  }
  add_own(own.size());
}

bool Serializer::Parts::Next(void** data, int* size) {
  const std::size_t begin = own_.size();
  // Parts returned before are no longer in use: they may move.
  own_.resize(begin + kBlock);
  *data = own_.data() + begin;
  *size = static_cast<int>(kBlock);
  return true;
}

void Serializer::Parts::BackUp(int count) {
  own_.resize(own_.size() - static_cast<std::size_t>(count));
}

bool Serializer::Parts::WriteAliasedRaw(const void* data, int size) {
  const auto count = static_cast<std::size_t>(size);
  runs_.push_back({.after = own_.size(), .bytes = {static_cast<const std::byte*>(data), count}});
  borrowed_size_ += count;
  return true;
}

std::span<const mcap::Bytes> Serializer::serialize(const google::protobuf::Message& message) {
  size_ = detail::serialized_size(message);
  if (size_ > kBytesMax) {
    throw std::length_error(message.GetTypeName() + " of " + std::to_string(size_) +
                            " bytes: protobuf holds at most 2 GiB");
  }
  stream_.clear();
  {
    google::protobuf::io::CodedOutputStream coded(&stream_);
    coded.EnableAliasing(true);
    // Map entries sorted by key: equal messages give equal bytes.
    coded.SetSerializationDeterministic(true);
    message.SerializeWithCachedSizes(&coded);
  }
  parts_.clear();
  stream_.gather(parts_);
  return parts_;
}

std::string Serializer::serialize_to_string(const google::protobuf::Message& message) {
  std::string bytes;
  for (const mcap::Bytes& part : serialize(message)) {
    bytes.append(reinterpret_cast<const char*>(part.data()), part.size());
  }
  return bytes;
}

}  // namespace fastcycle::record
