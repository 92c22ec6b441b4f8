#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "devices/descriptor.h"
#include "devices/device.h"

namespace ads {

/// A pixel format that cameras deliver.
enum class PixelFormat : std::uint8_t { kYuyv, kRgb, kGrey };

struct V4l2Config {
  std::string path;
  std::uint32_t width = 640;
  std::uint32_t height = 480;
  PixelFormat format = PixelFormat::kYuyv;
};

/// A picture in the driver's memory.
struct V4l2Frame {
  std::span<const std::byte> data;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t row_bytes = 0;
  std::int64_t age_ns = 0;  ///< The time since it was taken, from the driver's timestamp.
};

/// A camera of Linux (Video4Linux2); its pictures are read in place from the driver's buffers.
///
/// @threads  Confined to the thread that serves it.
class V4l2Device final : public Device {
 public:
  using Sink = std::function<void(const V4l2Frame&)>;

  V4l2Device(V4l2Config config, Sink sink) : config_(std::move(config)), sink_(std::move(sink)) {}
  ~V4l2Device() override { close(); }

  [[nodiscard]] std::string name() const override { return config_.path; }
  int open() override;
  bool read() override;
  void close() noexcept override;

  /// Pictures that the driver marked as damaged.
  [[nodiscard]] std::int64_t damaged() const { return damaged_; }

 private:
  struct Buffer {
    void* begin = nullptr;
    std::size_t size = 0;
  };

  void set_format();
  void map_buffers();

  V4l2Config config_;
  Sink sink_;
  Descriptor camera_;
  std::vector<Buffer> buffers_;
  std::uint32_t row_bytes_ = 0;
  std::int64_t damaged_ = 0;
};

}  // namespace ads
