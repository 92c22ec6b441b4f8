#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "mcap/records.h"
#include "recording.h"

namespace google::protobuf {
class Descriptor;
}  // namespace google::protobuf

namespace fastcycle::python {

/// The values of one field in all messages.
struct Column {
  using Values =
      std::variant<std::vector<double>, std::vector<float>, std::vector<std::int64_t>,
                   std::vector<std::uint64_t>, std::vector<std::int32_t>,
                   std::vector<std::uint32_t>, std::vector<std::uint8_t>, std::vector<std::string>>;
  enum class Kind : std::uint8_t { kNumber, kBool, kText, kBytes };

  std::string path;
  Kind kind = Kind::kNumber;
  Values values;  ///< Of what is missing 0, or an empty text.
  /// By row, whether the message does not have it: an element beyond the last one, a field of a
  /// message that is not set, an `optional` field that is not set.
  std::vector<std::uint8_t> missing = {};
  bool has_missing = false;
  std::map<int, std::string> names = {};  ///< Of an enumeration.
};

/// Takes the values of some fields out of serialized messages: everything else is passed over, and
/// no message is built.
///
///     ColumnReader reader(type, {"x_m", "objects[0].x_m"});
///     reader.add(bytes);
///     for (const Column& column : reader.take_columns()) { ... }
///
/// @threads  Confined.
class ColumnReader {
 public:
  /// @errors  As `find_field`.
  ColumnReader(const google::protobuf::Descriptor& type, const std::vector<std::string>& paths);
  ColumnReader(const ColumnReader&) = delete;
  ColumnReader& operator=(const ColumnReader&) = delete;
  ~ColumnReader();

  /// Adds a row. @errors  `std::runtime_error` if `message` is none of the type.
  void add(mcap::Bytes message);

  /// How many elements the repeated field had at most in a row, whose element 0 is in `path`:
  /// `objects[0].x_m`. @pre  `path` is one of those that are read, and has one such element.
  [[nodiscard]] std::size_t most_elements(const std::string& path) const;

  /// The columns, which are the caller's; no row is added afterwards.
  [[nodiscard]] std::vector<Column> take_columns() { return std::move(columns_); }

 private:
  struct Node;
  class Walk;

  const google::protobuf::Descriptor& type_;
  std::unique_ptr<Node> root_;
  std::vector<Column> columns_;
};

/// The columns of a topic, with a row for each message.
struct Table {
  std::vector<std::int64_t> log_times_ns;
  std::vector<Column> columns;
};

/// How many elements the repeated field of `path`, written as `objects[:].x_m`, has at most.
///
/// @errors  As `read_table`.
[[nodiscard]] std::size_t most_elements(const std::shared_ptr<const Recording>& recording,
                                        const mcap::MessageQuery& query, const std::string& path);

/// @errors  `NotFound`, `std::invalid_argument`, `mcap::Error`, all with file, topic and field.
[[nodiscard]] Table read_table(const std::shared_ptr<const Recording>& recording,
                               const mcap::MessageQuery& query,
                               const std::vector<std::string>& paths);

}  // namespace fastcycle::python
