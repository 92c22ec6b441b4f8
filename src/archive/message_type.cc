#include "archive/message_type.h"

#include <algorithm>
#include <cstddef>
#include <deque>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/wire_format.h>

#include "base/utf8.h"
#include "mcap/decode.h"

namespace fastcycle::archive {
namespace {

namespace pb = google::protobuf;
using pb::io::CodedInputStream;
using Wire = pb::internal::WireFormatLite;

constexpr std::uint64_t kMostSchemaBytes = std::uint64_t{8} << 20U;
constexpr std::uint64_t kMostBytesOfAllSchemas = std::uint64_t{32} << 20U;
constexpr int kMostNesting = 100;  // As protobuf itself has it.

int size_of(mcap::Bytes data) {
  return static_cast<int>(data.size());
}

// ---- From a schema to a type ----

/// Keeps the first error that protobuf finds in a file.
class FirstError final : public pb::DescriptorPool::ErrorCollector {
 public:
  void AddError(const std::string& file, const std::string& element, const pb::Message* /*what*/,
                ErrorLocation /*where*/, const std::string& message) override {
    if (text_.empty()) {
      text_ = fmt::format("{}: {}: {}", mcap::shown(file), mcap::shown(element), message);
    }
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// The files of a set, each after those that it imports.
class ImportOrder {
 public:
  explicit ImportOrder(const pb::FileDescriptorSet& set) : set_(set) {
    for (int i = 0; i < set.file_size(); ++i) {
      if (!numbers_.emplace(set.file(i).name(), i).second) {
        throw std::runtime_error("the file " + mcap::shown(set.file(i).name()) + " is in it twice");
      }
    }
    missing_.resize(static_cast<std::size_t>(set.file_size()));
    for (int i = 0; i < set.file_size(); ++i) {
      count_imports_of(i);
    }
  }

  [[nodiscard]] std::vector<const pb::FileDescriptorProto*> files() {
    std::deque<int> ready;
    for (int i = 0; i < set_.file_size(); ++i) {
      if (missing_[static_cast<std::size_t>(i)] == 0) {
        ready.push_back(i);
      }
    }
    std::vector<const pb::FileDescriptorProto*> result;
    for (; !ready.empty(); ready.pop_front()) {
      result.push_back(&set_.file(ready.front()));
      const auto [begin, end] = importers_.equal_range(ready.front());
      for (auto importer = begin; importer != end; ++importer) {
        if (--missing_[static_cast<std::size_t>(importer->second)] == 0) {
          ready.push_back(importer->second);
        }
      }
    }
    if (result.size() != missing_.size()) {
      throw std::runtime_error("its files import each other in a circle");
    }
    return result;
  }

 private:
  void count_imports_of(int number) {
    for (const std::string& import : set_.file(number).dependency()) {
      const auto found = numbers_.find(import);
      if (found == numbers_.end()) {
        throw std::runtime_error(fmt::format("{} imports {}, which is not in it",
                                             mcap::shown(set_.file(number).name()),
                                             mcap::shown(import)));
      }
      importers_.emplace(found->second, number);
      ++missing_[static_cast<std::size_t>(number)];
    }
  }

  const pb::FileDescriptorSet& set_;
  std::map<std::string, int> numbers_;
  std::vector<int> missing_;  // Imports that are not in order yet, by the number of the file.
  std::multimap<int, int> importers_;
};

// ---- Whether bytes are a message ----

/// Goes through the bytes of a message, and counts what it will take.
class WireCheck {
 public:
  /// `is_strict`: strings of proto2 have to be UTF-8 as well, violations of which protobuf prints
  /// to standard error.
  explicit WireCheck(mcap::Bytes data, bool is_strict = false)
      : input_(reinterpret_cast<const std::uint8_t*>(data.data()), size_of(data)),
        is_strict_(is_strict) {}

  [[nodiscard]] std::optional<std::string> find_wrong(const pb::Descriptor& type) {
    if (check(type, 0)) {
      return {};
    }
    return problem_.empty() ? fmt::format("bytes that end within {}", type.full_name())
                            : std::move(problem_);
  }

 private:
  bool fail(std::string problem) {
    problem_ = problem_.empty() ? std::move(problem) : problem_;
    return false;
  }

  bool takes(std::uint64_t bytes) {
    unpacked_ += bytes;
    return unpacked_ <= MessageType::kMostUnpackedBytes ||
           fail(fmt::format("a message that takes more than {} bytes when it is unpacked",
                            MessageType::kMostUnpackedBytes));
  }

  bool check(const pb::Descriptor& type, std::uint32_t end_tag) {
    // About what protobuf needs for an object with so many fields.
    const bool has_room = takes(64 + 40 * static_cast<std::uint64_t>(type.field_count()));
    if (!has_room || ++nesting_ > kMostNesting) {
      return fail(fmt::format("more than {} messages within each other", kMostNesting));
    }
    for (;;) {
      const std::uint32_t tag = input_.ReadTag();
      if (tag == 0) {
        --nesting_;
        return end_tag == 0 && input_.ConsumedEntireMessage();
      }
      if (end_tag != 0 && tag == end_tag) {
        --nesting_;
        return true;
      }
      if (!check_field(type, tag)) {
        return fail(fmt::format("bytes that are no field of {}", type.full_name()));
      }
    }
  }

  bool check_field(const pb::Descriptor& type, std::uint32_t tag) {
    const int number = Wire::GetTagFieldNumber(tag);
    const pb::FieldDescriptor* field = number > 0 ? type.FindFieldByNumber(number) : nullptr;
    if (field == nullptr) {
      return number > 0 && takes(16) && Wire::SkipField(&input_, tag);
    }
    const Wire::WireType wire = Wire::GetTagWireType(tag);
    const Wire::WireType wanted = pb::internal::WireFormat::WireTypeForFieldType(field->type());
    if (wire == Wire::WIRETYPE_LENGTH_DELIMITED && field->is_packable() && field->is_repeated()) {
      return check_packed(wanted);
    }
    if (wire != wanted) {
      return fail(fmt::format("wire type {} for {}, which has {}", static_cast<int>(wire),
                              field->full_name(), static_cast<int>(wanted)));
    }
    if (field->type() == pb::FieldDescriptor::TYPE_GROUP) {
      return check(*field->message_type(), Wire::MakeTag(number, Wire::WIRETYPE_END_GROUP));
    }
    if (wire == Wire::WIRETYPE_LENGTH_DELIMITED) {
      return check_delimited(*field);
    }
    return takes(8) && Wire::SkipField(&input_, tag);
  }

  bool check_delimited(const pb::FieldDescriptor& field) {
    std::uint32_t length = 0;
    if (!input_.ReadVarint32(&length) || !has(length)) {
      return false;
    }
    if (field.type() == pb::FieldDescriptor::TYPE_MESSAGE) {
      const CodedInputStream::Limit limit = input_.PushLimit(static_cast<int>(length));
      const bool is_right = check(*field.message_type(), 0);
      input_.PopLimit(limit);
      return is_right;
    }
    const void* bytes = nullptr;
    int available = 0;
    input_.GetDirectBufferPointerInline(&bytes, &available);
    const std::string_view text(static_cast<const char*>(bytes), length);
    const bool is_text =
        field.type() == pb::FieldDescriptor::TYPE_STRING &&
        (is_strict_ || field.file()->syntax() == pb::FileDescriptor::SYNTAX_PROTO3);
    if (is_text && !base::is_utf8(text)) {
      return fail("no UTF-8 in the text " + field.full_name());
    }
    return takes(48 + std::uint64_t{length}) && input_.Skip(static_cast<int>(length));
  }

  /// Whether `length` bytes are left, here and in the message around.
  bool has(std::uint32_t length) {
    const void* bytes = nullptr;
    int available = 0;  // Up to the limit that was pushed last.
    input_.GetDirectBufferPointerInline(&bytes, &available);
    return length <= static_cast<std::uint32_t>(std::max(available, 0));
  }

  bool check_packed(Wire::WireType wanted) {
    std::uint32_t length = 0;
    if (!input_.ReadVarint32(&length) || !has(length) || !takes(8 * std::uint64_t{length})) {
      return false;
    }
    if (wanted == Wire::WIRETYPE_FIXED32 || wanted == Wire::WIRETYPE_FIXED64) {
      const std::uint32_t size = wanted == Wire::WIRETYPE_FIXED32 ? 4 : 8;
      return length % size == 0 && input_.Skip(static_cast<int>(length));
    }
    const CodedInputStream::Limit limit = input_.PushLimit(static_cast<int>(length));
    bool is_right = true;
    while (is_right && input_.BytesUntilLimit() > 0) {
      std::uint64_t value = 0;
      is_right = input_.ReadVarint64(&value);
    }
    input_.PopLimit(limit);
    return is_right;
  }

  CodedInputStream input_;
  const bool is_strict_;
  int nesting_ = 0;
  std::uint64_t unpacked_ = 0;
  std::string problem_;
};

}  // namespace

MessageType::MessageType(const mcap::Schema& schema)
    : pool_(std::make_unique<pb::DescriptorPool>()),
      factory_(std::make_unique<pb::DynamicMessageFactory>()) {
  if (schema.encoding != "protobuf") {
    throw std::runtime_error("its encoding is " + mcap::shown(schema.encoding) +
                             ", not \"protobuf\"");
  }
  if (schema.data.size() > kMostSchemaBytes) {
    throw std::runtime_error(
        fmt::format("it has {} bytes, more than {}", schema.data.size(), kMostSchemaBytes));
  }
  if (const auto wrong = WireCheck(mcap::bytes_of(schema.data), true)
                             .find_wrong(*pb::FileDescriptorSet::descriptor())) {
    throw std::runtime_error("its data is no FileDescriptorSet: " + *wrong);
  }
  pb::FileDescriptorSet set;
  if (!set.ParsePartialFromArray(schema.data.data(), static_cast<int>(schema.data.size()))) {
    throw std::runtime_error("its data is no FileDescriptorSet");
  }
  FirstError error;
  for (const pb::FileDescriptorProto* file : ImportOrder(set).files()) {
    if (pool_->BuildFileCollectingErrors(*file, &error) == nullptr) {
      throw std::runtime_error(error.text().empty() ? "a file of it is wrong" : error.text());
    }
  }
  descriptor_ = pool_->FindMessageTypeByName(schema.name);
  if (descriptor_ == nullptr) {
    throw std::runtime_error("it does not define " + mcap::shown(schema.name));
  }
}

MessageType::~MessageType() = default;

std::optional<std::string> MessageType::find_wrong(mcap::Bytes data) const {
  if (data.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    return fmt::format("{} bytes, more than a message may have", data.size());
  }
  return WireCheck(data).find_wrong(*descriptor_);
}

std::unique_ptr<pb::Message> MessageType::parse(mcap::Bytes data) const {
  if (std::optional<std::string> wrong = find_wrong(data)) {
    throw std::runtime_error(*wrong);
  }
  std::unique_ptr<pb::Message> message(factory_->GetPrototype(descriptor_)->New());
  if (!message->ParsePartialFromArray(data.data(), size_of(data))) {
    throw std::runtime_error("bytes that are no " + descriptor_->full_name());
  }
  return message;
}

std::unique_ptr<pb::Message> MessageType::parse_json(std::string_view json) const {
  std::unique_ptr<pb::Message> message(factory_->GetPrototype(descriptor_)->New());
  const auto status =
      pb::util::JsonStringToMessage(pb::StringPiece(json.data(), json.size()), message.get());
  if (!status.ok()) {
    throw std::runtime_error(std::string(status.message()));
  }
  return message;
}

const MessageTypes::Found& MessageTypes::find(const mcap::Schema& schema) {
  const auto [place, is_new] = known_.try_emplace(schema.id);
  Known& known = place->second;
  if (!is_new) {
    return known.found;
  }
  try {
    schema_bytes_ += schema.data.size();
    if (schema_bytes_ > kMostBytesOfAllSchemas) {
      throw std::runtime_error(
          fmt::format("it and those before have more than {} bytes", kMostBytesOfAllSchemas));
    }
    known.type = std::make_unique<MessageType>(schema);
    known.found.type = known.type.get();
  } catch (const std::runtime_error& error) {
    known.found.problem = error.what();
  }
  return known.found;
}

}  // namespace fastcycle::archive
