#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>

#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/common/SerializedPayload.h>

#include "peers/common/stamps.h"

namespace fastcycle::peers {

/// The memory of a loan: the stamps, then the payload, unaligned, because Fast DDS puts four bytes
/// of encapsulation before it.
struct PlainBytes {
  unsigned char first;

  [[nodiscard]] static constexpr std::size_t bytes(std::size_t size) noexcept {
    return sizeof(Stamps) + size;
  }
  [[nodiscard]] unsigned char* data() noexcept { return &first + sizeof(Stamps); }
  [[nodiscard]] const unsigned char* data() const noexcept { return &first + sizeof(Stamps); }
  [[nodiscard]] Stamps stamps() const noexcept {
    Stamps stamps;
    std::memcpy(&stamps, &first, sizeof(stamps));
    return stamps;
  }
  void set_stamps(const Stamps& stamps) noexcept { std::memcpy(&first, &stamps, sizeof(stamps)); }
};
FASTDDS_SEQUENCE(PlainSequence, PlainBytes);

/// A plain, bounded type of one size, as Fast DDS requires for loans ("Zero-Copy communication",
/// constraints): the loan is the serialized form itself.
class PlainType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

  explicit PlainType(std::size_t size)
      : bytes_(static_cast<std::uint32_t>(PlainBytes::bytes(size))) {
    setName("fastcycle::peers::PlainType");
    m_typeSize = kEncapsulation + bytes_;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  [[nodiscard]] bool is_bounded() const override { return true; }
  [[nodiscard]] bool is_plain() const override { return true; }

  // Called only for messages that are not loans.
  bool serialize(void* data, Payload* payload) override {
    payload->encapsulation = CDR_LE;
    std::memset(payload->data, 0, kEncapsulation);
    payload->data[1] = CDR_LE;
    std::memcpy(payload->data + kEncapsulation, data, bytes_);
    payload->length = kEncapsulation + bytes_;
    return true;
  }
  bool deserialize(Payload* payload, void* data) override {
    std::memcpy(data, payload->data + kEncapsulation, bytes_);
    return payload->length == kEncapsulation + bytes_;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* /*data*/) override {
    return [size = m_typeSize] { return size; };
  }
  void* createData() override { return std::malloc(bytes_); }
  void deleteData(void* data) override { std::free(data); }
  bool getKey(void* /*data*/, eprosima::fastrtps::rtps::InstanceHandle_t* /*handle*/,
              bool /*force_md5*/) override {
    return false;
  }

 private:
  static constexpr std::uint32_t kEncapsulation = 4;
  const std::uint32_t bytes_;
};

}  // namespace fastcycle::peers
