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

/// What is wrong with a view, with its place.
class ViewMistake final : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Points in a field of bytes, all of the same size: where each has what.
struct PointLayout {
  std::size_t stride = 0;
  std::size_t x = 0;  ///< Of floats, little endian, in metres.
  std::size_t y = 0;
  std::size_t z = 0;
  std::optional<std::size_t> time = {};  ///< Of 16 bits: the part of the turn that was over.
  std::uint64_t most = 0;                ///< In all messages together.
};

/// What the page calls `name`, and where it is in a message.
struct Pick {
  std::string name;
  std::vector<std::string> path = {};
  int decimals = 3;
  int every = 1;  ///< Of a repeated field, one element of so many.
  bool is_time = false;
  std::optional<PointLayout> points = {};
  std::vector<Pick> fields = {};
};

/// What the page calls `name`, of the messages of a topic.
struct Layer {
  std::string name;
  std::string topic;
  double least_period_ns = 0.0;
  bool is_latched = false;  ///< Its messages hold until the next one comes, however late that is.
  std::vector<Pick> fields = {};
};

struct View {
  nlohmann::ordered_json constants;
  std::vector<Layer> layers;
};

/// Reads a view: JSON, with comments. What it says is in docs/reference/page.md.
///
/// @errors  `ViewMistake` with the place in it.
View parse_view(std::string_view text);

}  // namespace fastcycle::archive
