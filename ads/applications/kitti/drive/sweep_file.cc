#include "applications/kitti/drive/sweep_file.h"

#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <lzma.h>

#include "common/files.h"

namespace kitti {
namespace {

static_assert(std::endian::native == std::endian::little, "points are copied as they are");
static_assert(sizeof(Point) == 16);

// Thirty times what the sensor can give: what is larger is no sweep, but would fill the memory.
constexpr std::size_t kUnpackedMax = std::size_t{64} << 20;
constexpr std::uint64_t kMemoryMax = std::uint64_t{256} << 20;

std::string_view name_of(lzma_ret result) {
  switch (result) {
    case LZMA_FORMAT_ERROR:
      return "no xz file";
    case LZMA_DATA_ERROR:
      return "damaged data";
    case LZMA_OPTIONS_ERROR:
      return "options that this liblzma does not know";
    case LZMA_MEMLIMIT_ERROR:
      return "more memory needed than allowed";
    case LZMA_MEM_ERROR:
      return "no memory";
    case LZMA_BUF_ERROR:
      return "the end of the file";
    default:
      return "an error of liblzma";
  }
}

// The whole content, unpacked.
std::string unpack(const std::string& packed, const std::string& name) {
  lzma_stream stream = LZMA_STREAM_INIT;
  const auto end = [](lzma_stream* its) { lzma_end(its); };
  const std::unique_ptr<lzma_stream, decltype(end)> guard(&stream, end);
  lzma_ret result = lzma_stream_decoder(&stream, kMemoryMax, LZMA_CONCATENATED);
  std::string content;
  std::array<char, 65536> chunk;
  stream.next_in = reinterpret_cast<const std::uint8_t*>(packed.data());
  stream.avail_in = packed.size();
  while (result == LZMA_OK) {
    stream.next_out = reinterpret_cast<std::uint8_t*>(chunk.data());
    stream.avail_out = chunk.size();
    result = lzma_code(&stream, LZMA_FINISH);
    content.append(chunk.data(), chunk.size() - stream.avail_out);
    if (content.size() > kUnpackedMax) {
      throw std::runtime_error(
          fmt::format("{}: expected at most {} bytes unpacked, found more", name, kUnpackedMax));
    }
  }
  if (result != LZMA_STREAM_END) {
    throw std::runtime_error(fmt::format("{}: byte {}: expected xz data, found {}", name,
                                         stream.total_in, name_of(result)));
  }
  return content;
}

}  // namespace

std::vector<Point> read_sweep(const std::filesystem::path& file) {
  const std::string content = unpack(ads::read_file(file), file.string());
  if (content.empty() || content.size() % sizeof(Point) != 0) {
    throw std::runtime_error(
        fmt::format("{}: expected points of {} bytes each, found {} bytes unpacked", file.string(),
                    sizeof(Point), content.size()));
  }
  std::vector<Point> points(content.size() / sizeof(Point));
  std::memcpy(points.data(), content.data(), content.size());
  return points;
}

}  // namespace kitti
