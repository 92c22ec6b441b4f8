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

/// The way from a message to one of the messages in it.
using Way = std::vector<const google::protobuf::FieldDescriptor*>;

/// The message at the end of `way`; an empty one if it is absent.
[[nodiscard]] const google::protobuf::Message& at(const google::protobuf::Message& root,
                                                  const Way& way);
[[nodiscard]] google::protobuf::Message& mutable_at(google::protobuf::Message& root,
                                                    const Way& way);
[[nodiscard]] bool is_present(const google::protobuf::Message& root, const Way& way);

/// What is done with one field of ROS, in the order in which fields stand in the bytes.
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

/// A field of the message that is absent where the first number of another one is -1.
struct Absent {
  Way value;
  Way of_numbers;  ///< The message that has the numbers.
  const google::protobuf::FieldDescriptor* numbers = nullptr;
};

/// All steps of one type.
struct Steps {
  std::vector<std::unique_ptr<Step>> steps;
  std::vector<Absent> absent;

  void read(CdrReader& in, google::protobuf::Message& root) const;
  void write(const google::protobuf::Message& root, CdrWriter& out) const;
};

/// A field of ROS and its place in the message.
struct Pair {
  const Field* ros = nullptr;
  std::string path;  ///< For errors.
  Way way;
  const google::protobuf::FieldDescriptor* to = nullptr;
};

/// For a field that has no place: it is read over, and written as zero or as `constant`.
[[nodiscard]] std::unique_ptr<Step> make_skip(const Field& ros, std::string path,
                                              std::optional<double> constant);
/// For a message of ROS whose fields lie in the message at the end of `way`.
[[nodiscard]] std::unique_ptr<Step> make_message(const Field& ros, Way way, Steps steps);
/// For a sequence of messages.
[[nodiscard]] std::unique_ptr<Step> make_messages(Pair pair, Steps steps);
/// For everything else: numbers, texts, bytes, times; null if the two do not go together. If
/// `absent` is given, it is what an array of numbers that begins with -1 says is not there.
[[nodiscard]] std::unique_ptr<Step> make_value(Pair pair, const Rule& rule, const Way* absent);
/// For a number that lies as text in a list of keys and values.
[[nodiscard]] std::unique_ptr<Step> make_keyed(Pair pair, std::string key);

}  // namespace fastcycle::ros2
