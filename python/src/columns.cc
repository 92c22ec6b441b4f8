#include "columns.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format.h>

#include "archive/message_type.h"
#include "field_path.h"
#include "mcap/decode.h"
#include "mcap/error.h"
#include "not_found.h"

namespace fastcycle::python {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;
using Wire = pb::internal::WireFormatLite;
using pb::io::CodedInputStream;

Column::Values values_for(const Field& field) {
  switch (field.cpp_type()) {
    case Field::CPPTYPE_DOUBLE:
      return std::vector<double>();
    case Field::CPPTYPE_FLOAT:
      return std::vector<float>();
    case Field::CPPTYPE_INT64:
      return std::vector<std::int64_t>();
    case Field::CPPTYPE_UINT64:
      return std::vector<std::uint64_t>();
    case Field::CPPTYPE_INT32:
    case Field::CPPTYPE_ENUM:
      return std::vector<std::int32_t>();
    case Field::CPPTYPE_UINT32:
      return std::vector<std::uint32_t>();
    case Field::CPPTYPE_BOOL:
      return std::vector<std::uint8_t>();
    case Field::CPPTYPE_STRING:
    case Field::CPPTYPE_MESSAGE:
      break;
  }
  return std::vector<std::string>();
}

Column::Kind kind_of(const Field& field) {
  if (field.cpp_type() == Field::CPPTYPE_BOOL) {
    return Column::Kind::kBool;
  }
  if (field.cpp_type() == Field::CPPTYPE_STRING) {
    return field.type() == Field::TYPE_BYTES ? Column::Kind::kBytes : Column::Kind::kText;
  }
  return Column::Kind::kNumber;
}

std::map<int, std::string> names_of(const pb::EnumDescriptor* type) {
  std::map<int, std::string> names;
  for (int i = 0; type != nullptr && i < type->value_count(); ++i) {
    names.emplace(type->value(i)->number(), type->value(i)->name());
  }
  return names;
}

/// What stood on the wire as the value of a type of `bits` bytes.
template <typename T>
T from_wire(std::uint64_t bits, const Field& field) {
  if constexpr (std::is_same_v<T, double>) {
    return std::bit_cast<double>(bits);
  } else if constexpr (std::is_same_v<T, float>) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
  } else if constexpr (std::is_same_v<T, std::uint8_t>) {
    return bits != 0 ? 1 : 0;
  } else {
    if (field.type() == Field::TYPE_SINT32) {
      return static_cast<T>(Wire::ZigZagDecode32(static_cast<std::uint32_t>(bits)));
    }
    if (field.type() == Field::TYPE_SINT64) {
      return static_cast<T>(Wire::ZigZagDecode64(bits));
    }
    return static_cast<T>(bits);
  }
}

}  // namespace

/// The fields of one message, at one place, that somebody wants, each with what of it is wanted.
struct ColumnReader::Node {
  struct Leaf {
    std::size_t column = 0;
    int index = -1;
    bool is_there = false;  ///< In this row, as the following.
    std::uint64_t bits = 0;
    std::string_view text = {};
  };
  struct Entry {
    const Field* field = nullptr;
    std::vector<Leaf> leaves = {};
    std::vector<std::pair<int, std::unique_ptr<Node>>> nodes = {};  ///< By index, of a message.
    int seen = 0;  ///< Elements in this row so far.
    int most = 0;  ///< Elements in a row before, at most.
  };

  std::vector<Entry> entries;

  Entry& entry(const Field* field) {
    const auto found = std::ranges::find(entries, field, &Entry::field);
    return found != entries.end() ? *found : entries.emplace_back(Entry{.field = field});
  }

  void add(const std::vector<Step>& steps, std::size_t begin, std::size_t column) {
    Entry& next = entry(steps[begin].field);
    const int index = steps[begin].index;
    if (begin + 1 == steps.size()) {
      next.leaves.push_back({.column = column, .index = index});
      return;
    }
    auto found = std::ranges::find(next.nodes, index, [](const auto& node) { return node.first; });
    if (found == next.nodes.end()) {
      found = next.nodes.insert(found, {index, std::make_unique<Node>()});
    }
    found->second->add(steps, begin + 1, column);
  }

  void reset() {
    for (Entry& entry : entries) {
      entry.most = std::max(entry.most, entry.seen);
      entry.seen = 0;
      for (Leaf& leaf : entry.leaves) {
        leaf.is_there = false;
        leaf.bits = 0;
        leaf.text = {};
      }
      for (const auto& [index, node] : entry.nodes) {
        node->reset();
      }
    }
  }

  /// The message is there: its fields without presence have their defaults at least.
  void enter() {
    for (Entry& entry : entries) {
      if (!entry.field->is_repeated() && !entry.field->has_presence()) {
        for (Leaf& leaf : entry.leaves) {
          leaf.is_there = true;
        }
      }
    }
  }

  template <typename Take>
  void for_each_leaf(const Take& take) const {
    for (const Entry& entry : entries) {
      for (const Leaf& leaf : entry.leaves) {
        take(leaf, *entry.field);
      }
      for (const auto& [index, node] : entry.nodes) {
        node->for_each_leaf(take);
      }
    }
  }
};

/// Goes through the bytes of one message.
class ColumnReader::Walk {
 public:
  explicit Walk(mcap::Bytes bytes)
      : input_(reinterpret_cast<const std::uint8_t*>(bytes.data()),
               static_cast<int>(bytes.size())) {}

  /// Whether the bytes up to the limit are a message.
  bool read(Node& node) {
    node.enter();
    while (const std::uint32_t tag = input_.ReadTag()) {
      const int number = Wire::GetTagFieldNumber(tag);
      const auto entry = std::ranges::find_if(
          node.entries, [&](const auto& one) { return one.field->number() == number; });
      const bool is_right =
          entry == node.entries.end() ? Wire::SkipField(&input_, tag) : read_field(*entry, tag);
      if (!is_right) {
        return false;
      }
    }
    return input_.ConsumedEntireMessage();
  }

 private:
  using Entry = Node::Entry;

  bool read_field(Entry& entry, std::uint32_t tag) {
    const Field& field = *entry.field;
    const Wire::WireType wire = Wire::GetTagWireType(tag);
    const Wire::WireType wanted = pb::internal::WireFormat::WireTypeForFieldType(field.type());
    if (wire == Wire::WIRETYPE_LENGTH_DELIMITED && wanted != wire && field.is_packable()) {
      return field.is_repeated() && read_packed(entry, wanted);
    }
    if (wire != wanted) {
      return false;
    }
    if (wire != Wire::WIRETYPE_LENGTH_DELIMITED) {
      return read_number(entry, wanted);
    }
    std::string_view bytes;
    if (!read_length(bytes)) {
      return false;
    }
    const int index = field.is_repeated() ? entry.seen++ : -1;
    if (field.type() != Field::TYPE_MESSAGE) {
      set(entry, index, 0, bytes);
      return input_.Skip(static_cast<int>(bytes.size()));
    }
    for (const auto& [wanted_index, node] : entry.nodes) {
      if (wanted_index == index) {
        const CodedInputStream::Limit limit = input_.PushLimit(static_cast<int>(bytes.size()));
        const bool is_right = read(*node);
        input_.PopLimit(limit);
        return is_right;
      }
    }
    return input_.Skip(static_cast<int>(bytes.size()));
  }

  /// The length of a field, and the bytes behind it, which are not passed over.
  bool read_length(std::string_view& bytes) {
    std::uint32_t length = 0;
    if (!input_.ReadVarint32(&length)) {
      return false;
    }
    const void* begin = nullptr;
    int available = 0;  // Up to the limit.
    input_.GetDirectBufferPointerInline(&begin, &available);
    if (length > static_cast<std::uint32_t>(std::max(available, 0))) {
      return false;
    }
    bytes = {static_cast<const char*>(begin), length};
    return true;
  }

  bool read_bits(Wire::WireType wire, std::uint64_t& bits) {
    if (wire == Wire::WIRETYPE_VARINT) {
      return input_.ReadVarint64(&bits);
    }
    if (wire == Wire::WIRETYPE_FIXED64) {
      return input_.ReadLittleEndian64(&bits);
    }
    std::uint32_t half = 0;
    const bool is_right = wire == Wire::WIRETYPE_FIXED32 && input_.ReadLittleEndian32(&half);
    bits = half;
    return is_right;
  }

  bool read_number(Entry& entry, Wire::WireType wire) {
    std::uint64_t bits = 0;
    if (!read_bits(wire, bits)) {
      return false;
    }
    set(entry, entry.field->is_repeated() ? entry.seen++ : -1, bits, {});
    return true;
  }

  bool read_packed(Entry& entry, Wire::WireType wire) {
    std::string_view bytes;
    if (!read_length(bytes)) {
      return false;
    }
    const CodedInputStream::Limit limit = input_.PushLimit(static_cast<int>(bytes.size()));
    bool is_right = true;
    while (is_right && input_.BytesUntilLimit() > 0) {
      is_right = read_number(entry, wire);
    }
    input_.PopLimit(limit);
    return is_right;
  }

  static void set(Entry& entry, int index, std::uint64_t bits, std::string_view text) {
    for (Node::Leaf& leaf : entry.leaves) {
      if (leaf.index == index) {
        leaf.is_there = true;
        leaf.bits = bits;
        leaf.text = text;
      }
    }
  }

  CodedInputStream input_;
};

ColumnReader::ColumnReader(const pb::Descriptor& type, const std::vector<std::string>& paths)
    : type_(type), root_(std::make_unique<Node>()) {
  for (const std::string& path : paths) {
    const std::vector<Step> steps = find_field(type, path);
    const Field& field = *steps.back().field;
    root_->add(steps, 0, columns_.size());
    columns_.push_back({.path = path,
                        .kind = kind_of(field),
                        .values = values_for(field),
                        .names = names_of(field.enum_type())});
  }
}

ColumnReader::~ColumnReader() = default;

void ColumnReader::add(mcap::Bytes message) {
  root_->reset();
  const bool is_right =
      message.size() <= archive::MessageType::kMostUnpackedBytes && Walk(message).read(*root_);
  if (!is_right) {
    throw std::runtime_error(
        fmt::format("{} bytes that are no {}", message.size(), type_.full_name()));
  }
  root_->for_each_leaf([this](const Node::Leaf& leaf, const Field& field) {
    Column& column = columns_[leaf.column];
    column.missing.push_back(leaf.is_there ? 0 : 1);
    column.has_missing = column.has_missing || !leaf.is_there;
    std::visit(
        [&](auto& values) {
          using T = typename std::remove_reference_t<decltype(values)>::value_type;
          if constexpr (std::is_same_v<T, std::string>) {
            values.emplace_back(leaf.text);
          } else {
            values.push_back(from_wire<T>(leaf.bits, field));
          }
        },
        column.values);
  });
}

std::size_t ColumnReader::most_elements(const std::string& path) const {
  const Node* node = root_.get();
  for (const Step& step : find_field(type_, path)) {
    const auto entry = std::ranges::find(node->entries, step.field, &Node::Entry::field);
    if (step.index == 0) {
      return static_cast<std::size_t>(std::max(entry->most, entry->seen));
    }
    const auto next =
        std::ranges::find(entry->nodes, step.index, [](const auto& one) { return one.first; });
    node = next == entry->nodes.end() ? node : next->second.get();
  }
  return 0;
}

namespace {

constexpr std::string_view kAll = "[:]";

struct ReadTopic {
  std::unique_ptr<archive::MessageType> type;
  std::unique_ptr<ColumnReader> reader;  ///< Needs the type.
};

/// Gives each message of a topic to a reader of `paths`.
ReadTopic read(const std::shared_ptr<const Recording>& recording, const mcap::MessageQuery& query,
               const std::vector<std::string>& paths, std::vector<std::int64_t>& log_times_ns) {
  const std::string& topic = query.topics.at(0);
  const std::string place = fmt::format("{}: {}: ", recording->name(), mcap::shown(topic));
  const mcap::Schema& schema = recording->schema_of(topic);
  std::unique_ptr<archive::MessageType> type;
  std::unique_ptr<ColumnReader> reader;
  try {
    type = std::make_unique<archive::MessageType>(schema);
    reader = std::make_unique<ColumnReader>(type->descriptor(), paths);
  } catch (const NotFound& error) {
    throw NotFound(place + error.what());
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(place + error.what());
  } catch (const std::runtime_error& error) {
    throw mcap::Error({.place = {.file = recording->name()},
                       .record = "the schema of " + mcap::shown(topic),
                       .expected = "one that can be read",
                       .found = error.what()});
  }
  Cursor cursor(recording, query);
  while (const mcap::StoredMessage* const message = cursor.next()) {
    try {
      reader->add(message->data);
    } catch (const std::runtime_error& error) {
      throw mcap::Damage(
          {.place = {.file = recording->name()},
           .record = fmt::format("message {} on {}", message->sequence, mcap::shown(topic)),
           .expected = "a message of its type",
           .found = error.what()});
    }
    log_times_ns.push_back(static_cast<std::int64_t>(message->log_time_ns));
  }
  return {std::move(type), std::move(reader)};
}

}  // namespace

Table read_table(const std::shared_ptr<const Recording>& recording, const mcap::MessageQuery& query,
                 const std::vector<std::string>& paths) {
  Table table;
  table.columns = read(recording, query, paths, table.log_times_ns).reader->take_columns();
  return table;
}

std::size_t most_elements(const std::shared_ptr<const Recording>& recording,
                          const mcap::MessageQuery& query, const std::string& path) {
  std::string first = path;
  const std::size_t at = first.find(kAll);
  if (at == std::string::npos || first.find(kAll, at + 1) != std::string::npos) {
    throw std::invalid_argument(fmt::format("{}: expected one [:], found {}", mcap::shown(path),
                                            at == std::string::npos ? "none" : "several"));
  }
  first.replace(at, kAll.size(), "[0]");
  std::vector<std::int64_t> ignored;
  return read(recording, query, {first}, ignored).reader->most_elements(first);
}

}  // namespace fastcycle::python
