#pragma once

#include <memory>
#include <string>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "ros2/cdr.h"
#include "ros2/definition.h"
#include "ros2/mapping.h"

namespace fastcycle::ros2 {

/// The path from a message to one of the messages in it.
using Way = std::vector<const google::protobuf::FieldDescriptor*>;

/// The message at the end of `way`; an empty one if it is absent.
[[nodiscard]] const google::protobuf::Message& at(const google::protobuf::Message& root,
                                                  const Way& way);
[[nodiscard]] google::protobuf::Message& mutable_at(google::protobuf::Message& root,
                                                    const Way& way);
[[nodiscard]] bool is_present(const google::protobuf::Message& root, const Way& way);

/// The conversion of one ROS field, in the order of the serialized bytes.
///
/// @threads  Compatible.
class Step {
 public:
  Step() = default;
  Step(const Step&) = delete;
  Step& operator=(const Step&) = delete;
  virtual ~Step() = default;

  virtual void read(CdrReader& in, google::protobuf::Message& root) const = 0;
  virtual void write(const google::protobuf::Message& root, CdrWriter& out) const = 0;
};

/// A field of the message that is absent if the first number of another one is -1.
struct Absent {
  Way value;
  Way of_numbers;  ///< The message that contains the numbers.
  const google::protobuf::FieldDescriptor* numbers = nullptr;
};

/// All steps of one type.
struct Steps {
  std::vector<std::unique_ptr<Step>> steps;
  std::vector<Absent> absent;

  void read(CdrReader& in, google::protobuf::Message& root) const;
  void write(const google::protobuf::Message& root, CdrWriter& out) const;
};

/// A ROS field and its counterpart in the message.
struct Pair {
  const Field* ros = nullptr;
  std::string path;  ///< For errors.
  Way way;
  const google::protobuf::FieldDescriptor* to = nullptr;
};

/// For a field without a counterpart: skipped, and written as zero or as `constant`.
[[nodiscard]] std::unique_ptr<Step> make_skip(const Field& ros, std::string path,
                                              std::optional<double> constant);
/// For a ROS message whose fields are in the message at the end of `way`.
[[nodiscard]] std::unique_ptr<Step> make_message(const Field& ros, Way way, Steps steps);
/// For a sequence of messages.
[[nodiscard]] std::unique_ptr<Step> make_messages(Pair pair, Steps steps);
/// For everything else: numbers, texts, bytes, times; null if the two are incompatible. `absent`,
/// if given, is the field that is absent if the array of numbers begins with -1.
[[nodiscard]] std::unique_ptr<Step> make_value(Pair pair, const Rule& rule, const Way* absent);
/// For a number stored as text in a list of keys and values.
[[nodiscard]] std::unique_ptr<Step> make_keyed(Pair pair, std::string key);

}  // namespace fastcycle::ros2
