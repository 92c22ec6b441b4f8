#include "v4l2.h"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

namespace ads {
namespace {

// One that is read, one that is full, two that are written.
constexpr std::uint32_t kBuffers = 4;

int ask(int camera, unsigned long request, void* argument) {
  int result = -1;
  do {
    result = ::ioctl(camera, request, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

std::uint32_t fourcc_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::kYuyv:
      return V4L2_PIX_FMT_YUYV;
    case PixelFormat::kRgb:
      return V4L2_PIX_FMT_RGB24;
    case PixelFormat::kGrey:
      return V4L2_PIX_FMT_GREY;
  }
  return V4L2_PIX_FMT_YUYV;
}

std::int64_t age_ns_of(const v4l2_buffer& buffer) {
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) {
    return 0;
  }
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::max<std::int64_t>(0, (now.tv_sec - buffer.timestamp.tv_sec) * 1'000'000'000LL +
                                       now.tv_nsec - buffer.timestamp.tv_usec * 1000LL);
}

v4l2_buffer buffer_of(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

}  // namespace

int V4l2Device::open() {
  camera_ =
      checked_descriptor(::open(config_.path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC), name());
  v4l2_capability can{};
  if (ask(camera_.get(), VIDIOC_QUERYCAP, &can) < 0) {
    throw_errno(name());
  }
  const std::uint32_t its =
      (can.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? can.device_caps : can.capabilities;
  if ((its & V4L2_CAP_VIDEO_CAPTURE) == 0 || (its & V4L2_CAP_STREAMING) == 0) {
    throw std::system_error(ENOTSUP, std::generic_category(),
                            fmt::format("{}: it is no camera that streams", name()));
  }
  set_format();
  map_buffers();
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (ask(camera_.get(), VIDIOC_STREAMON, &type) < 0) {
    throw_errno(name());
  }
  return camera_.get();
}

// A driver takes the nearest that it has: another format is refused, another size is taken over.
void V4l2Device::set_format() {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = config_.width;
  format.fmt.pix.height = config_.height;
  format.fmt.pix.pixelformat = fourcc_of(config_.format);
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (ask(camera_.get(), VIDIOC_S_FMT, &format) < 0) {
    throw_errno(name());
  }
  if (format.fmt.pix.pixelformat != fourcc_of(config_.format)) {
    throw std::system_error(ENOTSUP, std::generic_category(),
                            fmt::format("{}: it does not have the param format", name()));
  }
  config_.width = format.fmt.pix.width;
  config_.height = format.fmt.pix.height;
  row_bytes_ = format.fmt.pix.bytesperline;
}

void V4l2Device::map_buffers() {
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (ask(camera_.get(), VIDIOC_REQBUFS, &request) < 0) {
    throw_errno(name());
  }
  for (std::uint32_t index = 0; index < request.count; ++index) {
    v4l2_buffer buffer = buffer_of(index);
    if (ask(camera_.get(), VIDIOC_QUERYBUF, &buffer) < 0) {
      throw_errno(name());
    }
    void* const begin = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED,
                               camera_.get(), buffer.m.offset);
    if (begin == MAP_FAILED) {
      throw_errno(name());
    }
    buffers_.push_back({.begin = begin, .size = buffer.length});
    if (ask(camera_.get(), VIDIOC_QBUF, &buffer) < 0) {
      throw_errno(name());
    }
  }
}

bool V4l2Device::read() {
  v4l2_buffer buffer = buffer_of(0);
  if (ask(camera_.get(), VIDIOC_DQBUF, &buffer) < 0) {
    if (errno == EAGAIN) {
      return false;
    }
    throw_errno(name());
  }
  const bool is_whole = (buffer.flags & V4L2_BUF_FLAG_ERROR) == 0 && buffer.index < buffers_.size();
  if (is_whole) {
    const Buffer& its = buffers_[buffer.index];
    sink_({.data = {static_cast<const std::byte*>(its.begin),
                    std::min<std::size_t>(buffer.bytesused, its.size)},
           .width = config_.width,
           .height = config_.height,
           .row_bytes = row_bytes_,
           .age_ns = age_ns_of(buffer)});
  } else {
    ++damaged_;
  }
  if (ask(camera_.get(), VIDIOC_QBUF, &buffer) < 0) {
    throw_errno(name());
  }
  return is_whole;
}

void V4l2Device::close() noexcept {
  for (const Buffer& buffer : buffers_) {
    ::munmap(buffer.begin, buffer.size);
  }
  buffers_.clear();
  camera_.reset();  // Which ends streaming.
}

}  // namespace ads
