#include "mcap/compression.h"

#include <algorithm>
#include <new>

#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

#include "fastcycle/assert.h"

namespace fastcycle::mcap {
namespace {

constexpr std::uint64_t kZstdBlockBytes = std::uint64_t{128} << 10U;
constexpr std::uint64_t kZstdLeastBlockBytes = 4;  // Compressed: a byte, so many times.
constexpr std::uint64_t kLz4MostRatio = 255;       // A byte of a length stands for 255 bytes.

// The remaining errors are a lack of memory and our own bugs.
std::size_t checked_lz4(std::size_t result) {
  if (LZ4F_isError(result) != 0U) {
    throw std::bad_alloc();
  }
  return result;
}

std::size_t checked_zstd(std::size_t result) {
  if (ZSTD_isError(result) != 0U) {
    throw std::bad_alloc();
  }
  return result;
}

template <typename Context>
Context* there(Context* context) {
  if (context == nullptr) {
    throw std::bad_alloc();
  }
  return context;
}

std::string other_size(std::uint64_t size) {
  return fmt::format("{} bytes", size);
}

}  // namespace

std::string_view name_of(Compression compression) {
  switch (compression) {
    case Compression::kLz4:
      return "lz4";
    case Compression::kZstd:
      return "zstd";
    case Compression::kNone:
      break;
  }
  return "";
}

std::optional<Compression> find_compression(std::string_view name) {
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    if (name == name_of(compression)) {
      return compression;
    }
  }
  return {};
}

bool can_become(Compression compression, std::uint64_t compressed_size,
                std::uint64_t uncompressed_size) {
  switch (compression) {
    case Compression::kLz4:
      return uncompressed_size / kLz4MostRatio <= compressed_size;
    case Compression::kZstd:
      return uncompressed_size / kZstdBlockBytes <= compressed_size / kZstdLeastBlockBytes;
    case Compression::kNone:
      break;
  }
  return compressed_size == uncompressed_size;
}

struct Compressor::Contexts {
  std::unique_ptr<LZ4F_cctx, decltype(&LZ4F_freeCompressionContext)> lz4{
      nullptr, LZ4F_freeCompressionContext};
  std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> zstd{nullptr, ZSTD_freeCCtx};
};

Compressor::Compressor() : contexts_(std::make_unique<Contexts>()) {}
Compressor::~Compressor() = default;

void Compressor::compress(Compression compression, int level, std::span<const Bytes> parts,
                          std::vector<std::byte>& into) {
  switch (compression) {
    case Compression::kLz4:
      return compress_lz4(level, parts, into);
    case Compression::kZstd:
      return compress_zstd(level, parts, into);
    case Compression::kNone:
      break;
  }
  into.clear();
  for (const Bytes part : parts) {
    into.insert(into.end(), part.begin(), part.end());
  }
}

void Compressor::compress_lz4(int level, std::span<const Bytes> parts,
                              std::vector<std::byte>& into) {
  if (!contexts_->lz4) {
    LZ4F_cctx* context = nullptr;
    checked_lz4(LZ4F_createCompressionContext(&context, LZ4F_VERSION));
    contexts_->lz4.reset(context);
  }
  LZ4F_preferences_t preferences{};
  preferences.frameInfo.contentSize = size_of(parts);
  preferences.compressionLevel = level;

  std::size_t size = 0;
  const auto room = [&](std::size_t needed) {
    if (into.size() < size + needed) {
      into.resize(size + needed);
    }
    return into.data() + size;
  };
  LZ4F_cctx* const context = contexts_->lz4.get();
  into.resize(LZ4F_HEADER_SIZE_MAX + LZ4F_compressBound(size_of(parts), &preferences));
  size += checked_lz4(
      LZ4F_compressBegin(context, room(LZ4F_HEADER_SIZE_MAX), into.size(), &preferences));
  for (const Bytes part : parts) {
    if (part.empty()) {
      continue;
    }
    std::byte* const to = room(LZ4F_compressBound(part.size(), &preferences));
    size += checked_lz4(
        LZ4F_compressUpdate(context, to, into.size() - size, part.data(), part.size(), nullptr));
  }
  std::byte* const to = room(LZ4F_compressBound(0, &preferences));
  size += checked_lz4(LZ4F_compressEnd(context, to, into.size() - size, nullptr));
  into.resize(size);
}

void Compressor::compress_zstd(int level, std::span<const Bytes> parts,
                               std::vector<std::byte>& into) {
  if (!contexts_->zstd) {
    contexts_->zstd.reset(there(ZSTD_createCCtx()));
  }
  ZSTD_CCtx* const context = contexts_->zstd.get();
  checked_zstd(ZSTD_CCtx_reset(context, ZSTD_reset_session_and_parameters));
  const ZSTD_bounds levels = ZSTD_cParam_getBounds(ZSTD_c_compressionLevel);
  checked_zstd(ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel,
                                      std::clamp(level, levels.lowerBound, levels.upperBound)));
  checked_zstd(ZSTD_CCtx_setPledgedSrcSize(context, size_of(parts)));

  into.resize(ZSTD_compressBound(size_of(parts)));
  ZSTD_outBuffer to{.dst = into.data(), .size = into.size(), .pos = 0};
  const auto feed = [&](Bytes part, ZSTD_EndDirective direction) {
    ZSTD_inBuffer from{.src = part.data(), .size = part.size(), .pos = 0};
    while (true) {
      const std::size_t left = checked_zstd(ZSTD_compressStream2(context, &to, &from, direction));
      if (direction == ZSTD_e_end ? left == 0 : from.pos == from.size) {
        return;
      }
      if (to.pos == to.size) {
        into.resize(into.size() + ZSTD_CStreamOutSize());
        to.dst = into.data();
        to.size = into.size();
      }
    }
  };
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
    feed(parts[i], ZSTD_e_continue);
  }
  feed(parts.empty() ? Bytes{} : parts.back(), ZSTD_e_end);
  into.resize(to.pos);
}

struct Decompressor::Contexts {
  std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> lz4{
      nullptr, LZ4F_freeDecompressionContext};
  std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> zstd{nullptr, ZSTD_freeDCtx};
};

Decompressor::Decompressor() : contexts_(std::make_unique<Contexts>()) {}
Decompressor::~Decompressor() = default;

std::optional<std::string> Decompressor::decompress(Compression compression, Bytes from,
                                                    std::span<std::byte> into) {
  switch (compression) {
    case Compression::kLz4:
      return decompress_lz4(from, into);
    case Compression::kZstd:
      return decompress_zstd(from, into);
    case Compression::kNone:
      break;
  }
  FASTCYCLE_ASSERT(from.size() == into.size(), "what is not compressed does not change its size");
  std::ranges::copy(from, into.begin());
  return {};
}

std::optional<std::string> Decompressor::decompress_lz4(Bytes from, std::span<std::byte> into) {
  if (!contexts_->lz4) {
    LZ4F_dctx* context = nullptr;
    checked_lz4(LZ4F_createDecompressionContext(&context, LZ4F_VERSION));
    contexts_->lz4.reset(context);
  }
  LZ4F_dctx* const context = contexts_->lz4.get();
  LZ4F_resetDecompressionContext(context);

  std::byte none{};  // LZ4 requires a valid pointer even to write nothing.
  std::size_t taken = 0;
  std::size_t made = 0;
  while (true) {
    std::size_t to_size = into.size() - made;
    std::size_t from_size = from.size() - taken;
    const std::size_t left = LZ4F_decompress(context, to_size == 0 ? &none : into.data() + made,
                                             &to_size, from.data() + taken, &from_size, nullptr);
    if (LZ4F_isError(left) != 0U) {
      return fmt::format("damage (lz4 says {})", LZ4F_getErrorName(left));
    }
    taken += from_size;
    made += to_size;
    if (left == 0) {
      break;
    }
    if (to_size == 0 && from_size == 0) {
      return made == into.size() ? "more bytes than that" : other_size(made) + " and then its end";
    }
  }
  if (made != into.size()) {
    return other_size(made);
  }
  if (taken != from.size()) {
    return fmt::format("{} bytes after its end", from.size() - taken);
  }
  return {};
}

std::optional<std::string> Decompressor::decompress_zstd(Bytes from, std::span<std::byte> into) {
  if (!contexts_->zstd) {
    contexts_->zstd.reset(there(ZSTD_createDCtx()));
  }
  const std::size_t made = ZSTD_decompressDCtx(contexts_->zstd.get(), into.data(), into.size(),
                                               from.data(), from.size());
  if (ZSTD_isError(made) != 0U) {
    return fmt::format("damage (zstd says {})", ZSTD_getErrorName(made));
  }
  if (made != into.size()) {
    return other_size(made);
  }
  return {};
}

}  // namespace fastcycle::mcap
