#include "measure/samples.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

namespace fastcycle::measure {
namespace {

struct Close {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

std::string trouble(const std::filesystem::path& file) {
  return file.string() + ": " + std::strerror(errno);
}

}  // namespace

void reserve(Samples& samples, std::int64_t count) {
  const std::size_t size = samples.size();
  samples.resize(size + static_cast<std::size_t>(count));
  samples.resize(size);
}

std::string write_samples(const std::filesystem::path& file, const Samples& samples) {
  File stream(std::fopen(file.c_str(), "wbe"));
  if (!stream) {
    return trouble(file);
  }
  const bool is_written =
      std::fwrite(samples.data(), sizeof(Sample), samples.size(), stream.get()) == samples.size();
  return is_written && std::fclose(stream.release()) == 0 ? std::string() : trouble(file);
}

std::string read_samples(const std::filesystem::path& file, Samples& samples) {
  samples.clear();
  const File stream(std::fopen(file.c_str(), "rbe"));
  if (!stream) {
    return trouble(file);
  }
  Sample sample;
  while (std::fread(&sample, sizeof(sample), 1, stream.get()) == 1) {
    samples.push_back(sample);
  }
  return std::ferror(stream.get()) != 0 ? trouble(file) : std::string();
}

Samples without_warmup(const Samples& samples, std::int64_t warmup) {
  Samples result;
  for (const Sample& sample : samples) {
    if (sample.number >= warmup) {
      result.push_back(sample);
    }
  }
  return result;
}

std::vector<std::int64_t> transfer_ns(const Samples& samples) {
  std::vector<std::int64_t> result;
  result.reserve(samples.size());
  for (const Sample& sample : samples) {
    result.push_back(sample.arrived_ns - sample.sent_ns);
  }
  return result;
}

std::vector<std::int64_t> end_to_end_ns(const Samples& samples) {
  std::vector<std::int64_t> result;
  result.reserve(samples.size());
  for (const Sample& sample : samples) {
    result.push_back(sample.arrived_ns - sample.made_ns);
  }
  return result;
}

std::vector<std::int64_t> interval_error_ns(const Samples& samples) {
  std::vector<std::int64_t> result;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].number == samples[i - 1].number + 1) {
      result.push_back((samples[i].arrived_ns - samples[i - 1].arrived_ns) -
                       (samples[i].sent_ns - samples[i - 1].sent_ns));
    }
  }
  return result;
}

}  // namespace fastcycle::measure
