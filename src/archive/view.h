#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace fastcycle::archive {

/// An error in a view, with its place.
class ViewError final : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Layout of the points in a field of bytes, all of the same size.
struct PointLayout {
  std::size_t stride = 0;
  std::size_t x = 0;  ///< Of floats, little endian, in metres.
  std::size_t y = 0;
  std::size_t z = 0;
  std::optional<std::size_t> time = {};  ///< Of 16 bits: the completed fraction of the turn.
  std::uint64_t most = 0;                ///< In all messages together.
};

/// A value that the page calls `name`, with its field of a message.
struct Pick {
  std::string name;
  std::vector<std::string> path = {};
  int decimals = 3;
  int every = 1;  ///< Of a repeated field, use every n-th element.
  bool is_time = false;
  std::optional<PointLayout> points = {};
  std::vector<Pick> fields = {};
};

/// A layer that the page calls `name`, from the messages of a topic.
struct Layer {
  std::string name;
  std::string topic;
  double least_period_ns = 0.0;
  bool is_latched = false;  ///< Its messages are valid until the next one.
  std::vector<Pick> fields = {};
};

struct View {
  nlohmann::ordered_json constants;
  std::vector<Layer> layers;
};

/// Parses a view: JSON, with comments. docs/reference/page.md has the format.
///
/// @errors  `ViewError` with the place in it.
View parse_view(std::string_view text);

}  // namespace fastcycle::archive
