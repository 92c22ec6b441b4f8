#include "archive/export.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "archive/message_text.h"
#include "archive/message_type.h"
#include "archive/progress.h"
#include "mcap/decode.h"
#include "mcap/error.h"

namespace fastcycle::archive {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

constexpr std::size_t kMostColumns = 4096;
constexpr std::size_t kMostFields = 100'000;  // Of all messages within each other.

std::string cell(std::string text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) {
    return text;
  }
  std::string quoted = "\"";
  for (const char letter : text) {
    quoted.append(letter == '"' ? 2 : 1, letter);
  }
  return quoted + '"';
}

/// Which columns there are, found by looking at all messages.
class Columns {
 public:
  Columns(const pb::Descriptor& type, std::size_t most_elements)
      : most_elements_(most_elements), root_(make(type)) {}

  void learn(const pb::Message& message) { learn(message, *root_); }

  [[nodiscard]] std::vector<std::string> names() {
    std::vector<std::string> names;
    add_names(*root_, "", names);
    return names;
  }

  /// Appends the cells of a message, each after a comma.
  void write(const pb::Message& message, std::string& row) const { write(message, *root_, row); }

  [[nodiscard]] std::vector<std::string> cut() const {
    std::vector<std::string> result;
    add_cut(*root_, "", result);
    return result;
  }

 private:
  struct Group;
  struct Node {
    const Field* field = nullptr;
    std::size_t longest = 0;       ///< Elements that there are, of a repeated field.
    std::unique_ptr<Group> group;  ///< Of a message, once one was seen.
    std::size_t columns = 0;       ///< Of one element; known with the names.
  };
  struct Group {
    std::vector<Node> nodes;
  };

  std::unique_ptr<Group> make(const pb::Descriptor& type) {
    fields_ += static_cast<std::size_t>(type.field_count());
    if (fields_ > kMostFields) {
      throw std::runtime_error(fmt::format("more than {} fields", kMostFields));
    }
    auto group = std::make_unique<Group>();
    for (int i = 0; i < type.field_count(); ++i) {
      group->nodes.push_back({.field = type.field(i), .longest = 0, .group = nullptr});
    }
    return group;
  }

  [[nodiscard]] std::size_t elements(const Node& node) const {
    return std::min(node.longest, most_elements_);
  }

  void learn(const pb::Message& message, Group& group) {
    const pb::Reflection& reflection = *message.GetReflection();
    for (Node& node : group.nodes) {
      const bool is_message = node.field->cpp_type() == Field::CPPTYPE_MESSAGE;
      if (node.field->is_repeated()) {
        const int size = reflection.FieldSize(message, node.field);
        node.longest = std::max(node.longest, static_cast<std::size_t>(size));
        for (int i = 0; is_message && i < size && static_cast<std::size_t>(i) < most_elements_;
             ++i) {
          learn_in(reflection.GetRepeatedMessage(message, node.field, i), node);
        }
      } else if (is_message && reflection.HasField(message, node.field)) {
        learn_in(reflection.GetMessage(message, node.field), node);
      }
    }
  }

  void learn_in(const pb::Message& message, Node& node) {
    if (node.group == nullptr) {
      node.group = make(*message.GetDescriptor());
    }
    learn(message, *node.group);
  }

  void add_names(Group& group, const std::string& path, std::vector<std::string>& names) {
    for (Node& node : group.nodes) {
      const std::string name = path.empty() ? node.field->name() : path + "." + node.field->name();
      if (!node.field->is_repeated()) {
        add_names_of(node, name, names);
        continue;
      }
      for (std::size_t i = 0; i < elements(node); ++i) {
        add_names_of(node, fmt::format("{}[{}]", name, i), names);
      }
    }
  }

  void add_names_of(Node& node, const std::string& name, std::vector<std::string>& names) {
    const std::size_t before = names.size();
    if (node.field->cpp_type() != Field::CPPTYPE_MESSAGE) {
      names.push_back(name);
    } else if (node.group != nullptr) {
      add_names(*node.group, name, names);
    }
    node.columns = names.size() - before;
    if (names.size() > kMostColumns) {
      throw std::runtime_error(fmt::format(
          "more than {} columns (fewer elements of repeated fields make fewer)", kMostColumns));
    }
  }

  void write(const pb::Message& message, const Group& group, std::string& row) const {
    const pb::Reflection& reflection = *message.GetReflection();
    for (const Node& node : group.nodes) {
      if (!node.field->is_repeated()) {
        const bool is_there =
            !node.field->has_presence() || reflection.HasField(message, node.field);
        write_one(message, node, -1, is_there, row);
        continue;
      }
      const int size = reflection.FieldSize(message, node.field);
      for (std::size_t i = 0; i < elements(node); ++i) {
        write_one(message, node, static_cast<int>(i), static_cast<int>(i) < size, row);
      }
    }
  }

  void write_one(const pb::Message& message, const Node& node, int index, bool is_there,
                 std::string& row) const {
    if (!is_there) {
      row.append(node.columns, ',');
    } else if (node.field->cpp_type() != Field::CPPTYPE_MESSAGE) {
      row += ',';
      row += node.field->type() == Field::TYPE_BYTES
                 ? bytes_size(message, *node.field, index)
                 : cell(scalar_text(message, *node.field, index));
    } else if (node.group != nullptr) {
      const pb::Reflection& reflection = *message.GetReflection();
      write(index < 0 ? reflection.GetMessage(message, node.field)
                      : reflection.GetRepeatedMessage(message, node.field, index),
            *node.group, row);
    }
  }

  static std::string bytes_size(const pb::Message& message, const Field& field, int index) {
    std::string memory;
    const pb::Reflection& reflection = *message.GetReflection();
    const std::string& bytes =
        index < 0 ? reflection.GetStringReference(message, &field, &memory)
                  : reflection.GetRepeatedStringReference(message, &field, index, &memory);
    return fmt::format("{}", bytes.size());
  }

  void add_cut(const Group& group, const std::string& path, std::vector<std::string>& cut) const {
    for (const Node& node : group.nodes) {
      const std::string name = path.empty() ? node.field->name() : path + "." + node.field->name();
      if (node.longest > most_elements_) {
        cut.push_back(
            fmt::format("{} (up to {} elements, {} columns)", name, node.longest, most_elements_));
      }
      if (node.group != nullptr) {
        add_cut(*node.group, name, cut);
      }
    }
  }

  const std::size_t most_elements_;
  std::size_t fields_ = 0;
  std::unique_ptr<Group> root_;
};

class Exporter {
 public:
  Exporter(const mcap::Reader& reader, const std::string& file, const TableOptions& options,
           const Progress& progress)
      : reader_(reader), file_(file), options_(options), progress_(progress) {
    find_type();
  }

  Table run(const std::function<void(std::string_view)>& write) {
    Columns columns(type_->descriptor(), options_.most_elements);
    for_each_message(
        [&](const mcap::Message& /*head*/, const pb::Message& message) { columns.learn(message); });
    std::string row = "log_time_ns,publish_time_ns,sequence";
    const std::vector<std::string> names = guarded([&] { return columns.names(); });
    for (const std::string& name : names) {
      row += ',' + cell(name);
    }
    write(row += "\r\n");
    Table table{.rows = 0, .columns = names.size() + 3, .cut = columns.cut()};
    for_each_message([&](const mcap::Message& head, const pb::Message& message) {
      row = fmt::format("{},{},{}", head.log_time_ns, head.publish_time_ns, head.sequence);
      columns.write(message, row);
      write(row += "\r\n");
      ++table.rows;
    });
    return table;
  }

 private:
  [[noreturn]] void fail(std::string expected, std::string found) const {
    throw mcap::Error({.place = {.file = file_},
                       .record = {},
                       .expected = std::move(expected),
                       .found = std::move(found)});
  }

  void find_type() {
    const mcap::Definitions& definitions = reader_.definitions();
    const mcap::Schema* schema = nullptr;
    bool is_there = false;
    for (const auto& [id, channel] : definitions.channels()) {
      if (channel.topic != options_.topic) {
        continue;
      }
      is_there = true;
      const mcap::Schema* const other = definitions.find_schema(channel.schema_id);
      if (channel.message_encoding != "protobuf" || other == nullptr) {
        fail("messages of protobuf, with a schema, on " + mcap::shown(options_.topic),
             "messages of " + mcap::shown(channel.message_encoding));
      }
      const bool is_same =
          schema == nullptr || (other->name == schema->name && other->data == schema->data);
      if (!is_same) {
        fail("messages of one type on " + mcap::shown(options_.topic),
             mcap::shown(schema->name) + " and " + mcap::shown(other->name));
      }
      schema = schema == nullptr ? other : schema;
    }
    if (!is_there) {
      fail("a topic " + mcap::shown(options_.topic), "none of this name");
    }
    type_ = guarded([&] { return std::make_unique<MessageType>(*schema); });
  }

  /// What `make` returns; its errors become those of this topic.
  template <typename Make>
  std::invoke_result_t<const Make&> guarded(const Make& make) const {
    try {
      return make();
    } catch (const mcap::Error&) {  // It has a place already.
      throw;
    } catch (const std::runtime_error& error) {
      fail("messages on " + mcap::shown(options_.topic) + " that make a table", error.what());
    }
  }

  template <typename Take>
  void for_each_message(const Take& take) {
    mcap::MessageReader messages = reader_.messages({.topics = {options_.topic}});
    while (const std::optional<mcap::StoredMessage> message = messages.next()) {
      guarded([&] {
        take(*message, *type_->parse(message->data));
        return true;
      });
      if (progress_ && ++done_ % kRecordsPerProgress == 0) {
        progress_(done_);
      }
    }
  }

  const mcap::Reader& reader_;
  const std::string file_;
  const TableOptions options_;
  const Progress& progress_;
  std::unique_ptr<MessageType> type_;
  std::uint64_t done_ = 0;
};

}  // namespace

Table export_table(const mcap::Reader& reader, const std::string& file, const TableOptions& options,
                   const std::function<void(std::string_view)>& write, const Progress& progress) {
  return Exporter(reader, file, options, progress).run(write);
}

}  // namespace fastcycle::archive
