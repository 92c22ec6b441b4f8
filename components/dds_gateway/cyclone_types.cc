#include "dds_gateway/cyclone_types.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <new>
#include <utility>

#include <dds/ddsi/q_radmin.h>

namespace fastcycle::dds_gateway {
namespace {

/// `c` is the part of Cyclone DDS, and comes first.
struct RawMessage {
  ddsi_serdata c{};
  ros2::Buffer bytes;
};

struct RawType {
  ddsi_sertype c{};
};

const RawMessage* raw(const ddsi_serdata* message) {
  return reinterpret_cast<const RawMessage*>(message);
}

RawMessage* make(const ddsi_sertype* type, ddsi_serdata_kind kind) {
  auto* const message = new RawMessage;
  ddsi_serdata_init(&message->c, type, kind);
  message->c.hash = type->serdata_basehash;  // Without keys, all are equal.
  return message;
}

// Pads to a multiple of four bytes, as messages are sent.
void fill_up(ros2::Buffer& bytes) {
  const std::size_t fill = (4 - bytes.size() % 4) % 4;
  std::memset(bytes.grow(fill), 0, fill);
}

// ---- Messages ----

bool is_equal_key(const ddsi_serdata* /*a*/, const ddsi_serdata* /*b*/) {
  return true;
}

std::uint32_t size_of(const ddsi_serdata* message) {
  return static_cast<std::uint32_t>(raw(message)->bytes.size());
}

/// From the received fragments, in order; they may overlap.
ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind,
                             const nn_rdata* fragment, std::size_t size) {
  RawMessage* const message = make(type, kind);
  std::byte* const to = message->bytes.grow(size);
  std::size_t filled = 0;
  for (; fragment != nullptr; fragment = fragment->nextfrag) {
    const std::size_t end = std::min<std::size_t>(fragment->maxp1, size);
    if (fragment->min > filled) {
      break;
    }
    if (end > filled) {
      const auto* const from = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
      std::memcpy(to + filled, from + (filled - fragment->min), end - filled);
      filled = end;
    }
  }
  if (filled < size) {
    delete message;
    return nullptr;
  }
  return &message->c;
}

ddsi_serdata* from_vectors(const ddsi_sertype* type, ddsi_serdata_kind kind,
                           ddsrt_msg_iovlen_t count, const ddsrt_iovec_t* vectors,
                           std::size_t size) {
  RawMessage* const message = make(type, kind);
  std::byte* to = message->bytes.grow(size);
  std::size_t left = size;
  for (ddsrt_msg_iovlen_t i = 0; i < count && left > 0; ++i) {
    const std::size_t part = std::min<std::size_t>(vectors[i].iov_len, left);
    std::memcpy(to, vectors[i].iov_base, part);
    to += part;
    left -= part;
  }
  if (left > 0) {
    delete message;
    return nullptr;
  }
  return &message->c;
}

ddsi_serdata* from_key_hash(const ddsi_sertype* type, const ddsi_keyhash* /*hash*/) {
  return &make(type, SDK_KEY)->c;
}

ddsi_serdata* from_sample(const ddsi_sertype* type, ddsi_serdata_kind /*kind*/,
                          const void* /*sample*/) {
  return &make(type, SDK_KEY)->c;
}

void to_bytes(const ddsi_serdata* message, std::size_t offset, std::size_t size, void* to) {
  std::memcpy(to, raw(message)->bytes.data() + offset, size);
}

ddsi_serdata* to_vector(const ddsi_serdata* message, std::size_t offset, std::size_t size,
                        ddsrt_iovec_t* vector) {
  // Cyclone DDS only reads it.
  vector->iov_base = const_cast<std::byte*>(raw(message)->bytes.data()) + offset;
  vector->iov_len = size;
  return ddsi_serdata_ref(message);
}

void end_vector(ddsi_serdata* message, const ddsrt_iovec_t* /*vector*/) {
  ddsi_serdata_unref(message);
}

bool to_sample(const ddsi_serdata* /*message*/, void* /*sample*/, void** /*buffer*/,
               void* /*limit*/) {
  return false;
}

ddsi_serdata* to_untyped(const ddsi_serdata* message) {
  RawMessage* const key = make(message->type, SDK_KEY);
  key->c.type = nullptr;
  return &key->c;
}

bool untyped_to_sample(const ddsi_sertype* /*type*/, const ddsi_serdata* /*message*/,
                       void* /*sample*/, void** /*buffer*/, void* /*limit*/) {
  return false;
}

void free_message(ddsi_serdata* message) {
  delete reinterpret_cast<RawMessage*>(message);
}

std::size_t print(const ddsi_sertype* /*type*/, const ddsi_serdata* message, char* to,
                  std::size_t size) {
  const int written = std::snprintf(to, size, "%zu bytes", raw(message)->bytes.size());
  return std::min(size, static_cast<std::size_t>(std::max(0, written)));
}

void get_key_hash(const ddsi_serdata* /*message*/, ddsi_keyhash* hash, bool /*is_md5*/) {
  std::memset(hash, 0, sizeof *hash);
}

const ddsi_serdata_ops* message_functions() {
  static const ddsi_serdata_ops kFunctions = [] {
    ddsi_serdata_ops functions{};
    functions.eqkey = is_equal_key;
    functions.get_size = size_of;
    functions.from_ser = from_fragments;
    functions.from_ser_iov = from_vectors;
    functions.from_keyhash = from_key_hash;
    functions.from_sample = from_sample;
    functions.to_ser = to_bytes;
    functions.to_ser_ref = to_vector;
    functions.to_ser_unref = end_vector;
    functions.to_sample = to_sample;
    functions.to_untyped = to_untyped;
    functions.untyped_to_sample = untyped_to_sample;
    functions.free = free_message;
    functions.print = print;
    functions.get_keyhash = get_key_hash;
    return functions;
  }();
  return &kFunctions;
}

// ---- Types ----

void free_type(ddsi_sertype* type) {
  ddsi_sertype_fini(type);
  delete reinterpret_cast<RawType*>(type);
}

void zero_samples(const ddsi_sertype* /*type*/, void* /*samples*/, std::size_t /*count*/) {}

void realloc_samples(void** samples, const ddsi_sertype* /*type*/, void* /*old*/,
                     std::size_t /*old_count*/, std::size_t count) {
  std::fill_n(samples, count, nullptr);
}

void free_samples(const ddsi_sertype* /*type*/, void** /*samples*/, std::size_t /*count*/,
                  dds_free_op_t /*how*/) {}

// Called only for equal names.
bool is_equal_type(const ddsi_sertype* /*a*/, const ddsi_sertype* /*b*/) {
  return true;
}

std::uint32_t hash_type(const ddsi_sertype* /*type*/) {
  return 0;
}

const ddsi_sertype_ops* type_functions() {
  static const ddsi_sertype_ops kFunctions = [] {
    ddsi_sertype_ops functions{};
    functions.version = ddsi_sertype_v0;
    functions.free = free_type;
    functions.zero_samples = zero_samples;
    functions.realloc_samples = realloc_samples;
    functions.free_samples = free_samples;
    functions.equal = is_equal_type;
    functions.hash = hash_type;
    return functions;
  }();
  return &kFunctions;
}

}  // namespace

ddsi_sertype* make_raw_type(const char* name) {
  auto* const type = new RawType;
  ddsi_sertype_init(&type->c, name, type_functions(), message_functions(), true);
  type->c.allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  return &type->c;
}

ddsi_serdata* make_raw_message(const ddsi_sertype* type, ros2::Buffer bytes) {
  RawMessage* const message = make(type, SDK_DATA);
  message->bytes = std::move(bytes);
  fill_up(message->bytes);
  return &message->c;
}

std::span<const std::byte> bytes_of(const ddsi_serdata* message) {
  return raw(message)->bytes.bytes();
}

}  // namespace fastcycle::dds_gateway
