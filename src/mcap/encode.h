#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mcap/records.h"

/// Encodes records into the bytes of a file.
namespace fastcycle::mcap {

/// Opcode and length, with which every record begins.
inline constexpr std::size_t kFrameBytes = 1 + 8;
/// The fields of a message before its data.
inline constexpr std::size_t kMessageHeadBytes = 2 + 4 + 8 + 8;
/// The content of a footer; it never grows, so that readers find it from the end of the file.
inline constexpr std::size_t kFooterBytes = 8 + 8 + 4;

/// Appends a complete record, opcode and length included, to `into`: any kind without data.
///
/// @errors  `std::length_error` if a text, a map or an index is longer than 4 GiB.
template <typename Kind>
void encode(const Kind& record, std::vector<std::byte>& into);

/// The beginning of a message record; `data_size` bytes of data have to follow.
[[nodiscard]] std::array<std::byte, kFrameBytes + kMessageHeadBytes> encode_head(
    const MessageHead& head, std::uint64_t data_size);
/// The beginning of a chunk record; `records_size` bytes have to follow. Its `records` are not
/// used.
void encode_head(const Chunk& chunk, std::uint64_t records_size, std::vector<std::byte>& into);
/// The beginning of an attachment record; `data_size` bytes and the CRC (4 bytes) have to follow.
void encode_head(const AttachmentHead& head, std::uint64_t data_size, std::vector<std::byte>& into);

/// `value` in little-endian byte order, as the format requires.
[[nodiscard]] std::array<std::byte, 4> encode_u32(std::uint32_t value);

}  // namespace fastcycle::mcap
