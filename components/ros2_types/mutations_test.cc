// Real messages with bytes changed, cut and added at random: whatever comes, reading it ends with a
// message or with a `CdrError`, and takes no more memory than it has bytes. tests/soak/ros2 does it
// ten million times.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "ros2/json_form.h"
#include "ros2_types/known_types.h"

namespace fastcycle::ros2 {
namespace {

using Bytes = std::vector<std::byte>;

struct Real {
  std::string type;
  Bytes bytes;
};

std::vector<Real> real_messages() {
  std::vector<Real> all;
  const std::filesystem::path folder = FASTCYCLE_TEST_DATA;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / "wire")) {
    if (entry.is_regular_file()) {
      std::ifstream stream(entry.path(), std::ios::binary);
      const std::string text{std::istreambuf_iterator<char>(stream), {}};
      const auto* const begin = reinterpret_cast<const std::byte*>(text.data());
      // sensor_msgs__Imu__1.cdr
      const std::string name = entry.path().filename().string();
      const std::size_t middle = name.find("__");
      const std::size_t end = name.rfind("__");
      all.push_back(
          {.type = name.substr(0, middle) + "/msg/" + name.substr(middle + 2, end - middle - 2),
           .bytes = {begin, begin + std::min<std::size_t>(text.size(), 2048)}});
    }
  }
  return all;
}

class Mutations {
 public:
  explicit Mutations(unsigned seed) : random_(seed) {}

  Real next() {
    Real real = real_[below(real_.size())];
    Bytes& bytes = real.bytes;
    for (std::size_t left = 1 + below(6); left > 0 && !bytes.empty(); --left) {
      const std::size_t at = below(bytes.size());
      switch (below(6)) {
        case 0:
          bytes[at] = static_cast<std::byte>(random_());
          break;
        case 1:
          bytes.resize(at);
          break;
        case 2:
          bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), 1 + below(16),
                       static_cast<std::byte>(random_()));
          break;
        case 3: {  // What looks like a length.
          constexpr std::uint32_t kLengths[] = {0,       1,          0xff,       0xffff,
                                                1 << 20, 0x7fffffff, 0x80000000, 0xffffffff};
          std::uint32_t length = kLengths[below(std::size(kLengths))];
          for (std::size_t i = at / 4 * 4; i < bytes.size() && i < at / 4 * 4 + 4; ++i) {
            bytes[i] = static_cast<std::byte>(length);
            length >>= 8U;
          }
          break;
        }
        case 4:  // Another order of bytes.
          if (bytes.size() > 1) {
            bytes[1] ^= std::byte{1};
          }
          break;
        default: {
          const Bytes& other = real_[below(real_.size())].bytes;
          const std::size_t from = below(other.size());
          bytes.insert(bytes.end(), other.begin() + static_cast<std::ptrdiff_t>(from), other.end());
        }
      }
    }
    return real;
  }
  std::size_t below(std::size_t bound) { return random_() % bound; }

 private:
  std::mt19937_64 random_;
  std::vector<Real> real_ = real_messages();
};

TEST(ManyMutations, AreReadOrRefused) {
  const char* const asked = std::getenv("FASTCYCLE_ROS2_MUTATIONS");
  const char* const seed = std::getenv("FASTCYCLE_ROS2_SEED");
  const std::uint64_t count = asked == nullptr ? 30'000 : std::strtoull(asked, nullptr, 10);
  Mutations mutations(seed == nullptr ? 1 : static_cast<unsigned>(std::strtoul(seed, nullptr, 10)));
  KnownTypes types;
  std::vector<const Converter*> converters;
  std::vector<std::unique_ptr<google::protobuf::Message>> messages;
  for (const Mapping& mapping : types.mappings().all()) {
    converters.push_back(&types.find(mapping.ros, mapping.message));
    messages.emplace_back(converters.back()->prototype().New());
  }
  std::uint64_t read = 0;
  std::uint64_t refused = 0;
  Buffer written;

  for (std::uint64_t i = 0; i < count; ++i) {
    const auto [name, bytes] = mutations.next();
    // Mostly as what it was.
    std::size_t type = mutations.below(converters.size());
    for (std::size_t own = 0; own < converters.size() && mutations.below(256) != 0; ++own) {
      type = converters[own]->definition().name == name ? own : type;
    }
    try {
      converters[type]->to_message(bytes, *messages[type]);
      ++read;
      // A field of a point's layout may stand for many.
      constexpr std::size_t kShapeBytes = 512 * 1024;
      ASSERT_LE(messages[type]->ByteSizeLong(), 8 * bytes.size() + kShapeBytes);
      written.clear();
      converters[type]->to_ros(*messages[type], written);
      if (i % 16 == 0) {
        (void)to_json(converters[type]->definition(), bytes);
      }
    } catch (const CdrError&) {
      ++refused;
    }
  }

  EXPECT_GT(read, count / 100);
  EXPECT_GT(refused, count / 100);
  std::printf("%llu read, %llu refused\n", static_cast<unsigned long long>(read),
              static_cast<unsigned long long>(refused));
}

}  // namespace
}  // namespace fastcycle::ros2
