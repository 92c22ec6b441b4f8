#include "inspect/elide.h"

#include <algorithm>
#include <string>
#include <vector>

namespace fastcycle::inspect {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

constexpr std::size_t kMaxNesting = 32;

class Copier {
 public:
  Copier(const ElisionLimits& limits,
         google::protobuf::RepeatedPtrField<protocol::Elision>& elisions)
      : limits_(limits), elisions_(elisions), left_(limits.fields) {}

  void copy(const Message& from, Message& to) {
    std::vector<const FieldDescriptor*> fields;
    from.GetReflection()->ListFields(from, &fields);
    for (const FieldDescriptor* field : fields) {
      const std::size_t name_size = name_.size();
      name_ += (name_.empty() ? "" : ".") + field->name();
      path_.push_back(static_cast<std::uint32_t>(field->number()));
      if (field->is_repeated()) {
        copy_repeated(from, to, *field);
      } else {
        copy_single(from, to, *field);
      }
      path_.pop_back();
      name_.resize(name_size);
    }
  }

 private:
  void note(std::size_t size, std::size_t kept) {
    protocol::Elision& elision = *elisions_.Add();
    elision.mutable_path()->Add(path_.begin(), path_.end());
    elision.set_name(name_);
    elision.set_size(size);
    elision.set_kept(kept);
  }

  /// Whether there is room for one more.
  bool take() {
    left_ -= left_ > 0 ? 1 : 0;
    return left_ > 0;
  }

  /// As much of `text` as is kept.
  std::string shortened(const std::string& text, const FieldDescriptor& field) {
    std::size_t kept = std::min(text.size(), limits_.bytes);
    if (field.type() == FieldDescriptor::TYPE_STRING && kept < text.size()) {
      while (kept > 0 && (static_cast<unsigned char>(text[kept]) & 0xc0U) == 0x80U) {
        --kept;
      }
    }
    if (kept < text.size()) {
      note(text.size(), kept);
    }
    return text.substr(0, kept);
  }

  void copy_single(const Message& from, Message& to, const FieldDescriptor& field) {
    const Reflection& read = *from.GetReflection();
    const Reflection& write = *to.GetReflection();
    if (!take()) {
      note(1, 0);
      return;
    }
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_INT32:
        write.SetInt32(&to, &field, read.GetInt32(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        write.SetInt64(&to, &field, read.GetInt64(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_UINT32:
        write.SetUInt32(&to, &field, read.GetUInt32(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_UINT64:
        write.SetUInt64(&to, &field, read.GetUInt64(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_DOUBLE:
        write.SetDouble(&to, &field, read.GetDouble(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_FLOAT:
        write.SetFloat(&to, &field, read.GetFloat(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        write.SetBool(&to, &field, read.GetBool(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        write.SetEnumValue(&to, &field, read.GetEnumValue(from, &field));
        break;
      case FieldDescriptor::CPPTYPE_STRING: {
        std::string scratch;
        write.SetString(&to, &field,
                        shortened(read.GetStringReference(from, &field, &scratch), field));
        break;
      }
      case FieldDescriptor::CPPTYPE_MESSAGE:
        if (path_.size() >= 2 * kMaxNesting) {
          note(1, 0);
        } else {
          copy(read.GetMessage(from, &field), *write.MutableMessage(&to, &field));
        }
        break;
    }
  }

  void copy_repeated(const Message& from, Message& to, const FieldDescriptor& field) {
    const auto size = static_cast<std::size_t>(from.GetReflection()->FieldSize(from, &field));
    std::size_t kept = 0;
    const std::size_t name_size = name_.size();
    for (; kept < std::min(size, limits_.elements) && path_.size() < 2 * kMaxNesting && take();
         ++kept) {
      name_ += "[" + std::to_string(kept) + "]";
      path_.push_back(static_cast<std::uint32_t>(kept));
      add(from, to, field, static_cast<int>(kept));
      path_.pop_back();
      name_.resize(name_size);
    }
    if (kept < size) {
      note(size, kept);
    }
  }

  void add(const Message& from, Message& to, const FieldDescriptor& field, int index) {
    const Reflection& read = *from.GetReflection();
    const Reflection& write = *to.GetReflection();
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_INT32:
        write.AddInt32(&to, &field, read.GetRepeatedInt32(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        write.AddInt64(&to, &field, read.GetRepeatedInt64(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_UINT32:
        write.AddUInt32(&to, &field, read.GetRepeatedUInt32(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_UINT64:
        write.AddUInt64(&to, &field, read.GetRepeatedUInt64(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_DOUBLE:
        write.AddDouble(&to, &field, read.GetRepeatedDouble(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_FLOAT:
        write.AddFloat(&to, &field, read.GetRepeatedFloat(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        write.AddBool(&to, &field, read.GetRepeatedBool(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        write.AddEnumValue(&to, &field, read.GetRepeatedEnumValue(from, &field, index));
        break;
      case FieldDescriptor::CPPTYPE_STRING: {
        std::string scratch;
        write.AddString(
            &to, &field,
            shortened(read.GetRepeatedStringReference(from, &field, index, &scratch), field));
        break;
      }
      case FieldDescriptor::CPPTYPE_MESSAGE:
        copy(read.GetRepeatedMessage(from, &field, index), *write.AddMessage(&to, &field));
        break;
    }
  }

  const ElisionLimits& limits_;
  google::protobuf::RepeatedPtrField<protocol::Elision>& elisions_;
  std::size_t left_;
  std::string name_;
  std::vector<std::uint32_t> path_;
};

}  // namespace

void copy_elided(const Message& from, Message& to, const ElisionLimits& limits,
                 google::protobuf::RepeatedPtrField<protocol::Elision>& elisions) {
  to.Clear();
  Copier(limits, elisions).copy(from, to);
}

}  // namespace fastcycle::inspect
