#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "mcap/error.h"
#include "mcap/records.h"

/// Decodes the bytes of a file into records.
namespace fastcycle::mcap {

/// Opcode and length of a record.
struct Frame {
  Opcode opcode{};
  std::uint64_t length = 0;  ///< Of the content that follows.
};

/// @pre  `bytes` has at least `kFrameBytes`.
[[nodiscard]] Frame decode_frame(Bytes bytes);

/// The record whose content is `content`; none if its opcode is unknown. Bytes after the known
/// fields are ignored: later versions of the format may add fields. Data is borrowed from
/// `content`. `place` is that of the record, for errors.
///
/// @errors  `Damage` if a field does not fit.
[[nodiscard]] std::optional<Record> decode(Opcode opcode, Bytes content, const Place& place);

/// The same for a record whose kind is known.
template <typename Kind>
[[nodiscard]] Kind decode_as(Bytes content, const Place& place);

/// The beginning of a chunk whose end may be missing: its `records` are what is there.
[[nodiscard]] Chunk decode_begun_chunk(Bytes content, const Place& place);

/// The CRC that an attachment has at its end; see also `Attachment` in the format.
struct AttachmentCrc {
  std::uint32_t written = 0;   ///< 0: not computed.
  std::uint32_t computed = 0;  ///< Of the fields before it.
};
[[nodiscard]] AttachmentCrc crc_of_attachment(Bytes content, const Place& place);

/// `text` in quotation marks, without control characters, shortened if it is long: for messages.
[[nodiscard]] std::string shown(std::string_view text);

}  // namespace fastcycle::mcap
