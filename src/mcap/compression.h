#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mcap/records.h"

namespace fastcycle::mcap {

enum class Compression : std::uint8_t { kNone, kLz4, kZstd };

/// The name used in files: empty, `lz4`, `zstd`.
[[nodiscard]] std::string_view name_of(Compression compression);
/// None if the name is unknown.
[[nodiscard]] std::optional<Compression> find_compression(std::string_view name);

/// Compresses; keeps its working memory from one call to the next.
///
/// @threads  Confined.
class Compressor {
 public:
  Compressor();
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;
  ~Compressor();

  /// Compresses the concatenation of `parts`; overwrites `into`. `level` 0 is the default of the
  /// method; `lz4` supports up to 12, `zstd` up to 22, and negative ones, which are faster.
  ///
  /// @errors  `std::bad_alloc`.
  void compress(Compression compression, int level, std::span<const Bytes> parts,
                std::vector<std::byte>& into);

 private:
  void compress_lz4(int level, std::span<const Bytes> parts, std::vector<std::byte>& into);
  void compress_zstd(int level, std::span<const Bytes> parts, std::vector<std::byte>& into);

  struct Contexts;
  const std::unique_ptr<Contexts> contexts_;
};

/// Decompresses; keeps its working memory (at most some MiB) from one call to the next.
///
/// @threads  Confined.
class Decompressor {
 public:
  Decompressor();
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;
  ~Decompressor();

  /// Fills all of `into`. Returns an error if `from` does not decompress to exactly that many
  /// bytes.
  ///
  /// @pre  `into` and `from` are of the same size if there is no compression.
  [[nodiscard]] std::optional<std::string> decompress(Compression compression, Bytes from,
                                                      std::span<std::byte> into);

 private:
  [[nodiscard]] std::optional<std::string> decompress_lz4(Bytes from, std::span<std::byte> into);
  [[nodiscard]] std::optional<std::string> decompress_zstd(Bytes from, std::span<std::byte> into);

  struct Contexts;
  const std::unique_ptr<Contexts> contexts_;
};

/// Whether `compressed_size` bytes can decompress to `uncompressed_size` bytes at all: the sizes in
/// a file are checked with this before memory is allocated.
[[nodiscard]] bool can_become(Compression compression, std::uint64_t compressed_size,
                              std::uint64_t uncompressed_size);

}  // namespace fastcycle::mcap
