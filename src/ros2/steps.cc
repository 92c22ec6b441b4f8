#include "ros2/steps.h"

#include <charconv>
#include <climits>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "ros2/kinds.h"

namespace fastcycle::ros2 {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using google::protobuf::RepeatedField;
using Cpp = FieldDescriptor::CppType;

constexpr std::int64_t kSecond_ns = 1'000'000'000;

// ---- Numbers of protobuf ----

/// Calls `f` with a zero of the C++ type of a number field; an enum is an int32.
template <typename F>
decltype(auto) with_ours(const FieldDescriptor& field, F&& f) {
  switch (field.cpp_type()) {
    case Cpp::CPPTYPE_INT64:
      return f(std::int64_t{});
    case Cpp::CPPTYPE_UINT32:
      return f(std::uint32_t{});
    case Cpp::CPPTYPE_UINT64:
      return f(std::uint64_t{});
    case Cpp::CPPTYPE_FLOAT:
      return f(float{});
    case Cpp::CPPTYPE_DOUBLE:
      return f(double{});
    case Cpp::CPPTYPE_BOOL:
      return f(bool{});
    default:
      return f(std::int32_t{});
  }
}

bool is_number(const FieldDescriptor& field) {
  return field.cpp_type() != Cpp::CPPTYPE_STRING && field.cpp_type() != Cpp::CPPTYPE_MESSAGE;
}

bool is_number(Kind kind) {
  return size_of(kind) != 0;
}

template <typename T>
T get(const Message& message, const FieldDescriptor& field) {
  const Reflection& reflection = *message.GetReflection();
  if constexpr (std::is_same_v<T, bool>) {
    return reflection.GetBool(message, &field);
  } else if constexpr (std::is_same_v<T, float>) {
    return reflection.GetFloat(message, &field);
  } else if constexpr (std::is_same_v<T, double>) {
    return reflection.GetDouble(message, &field);
  } else if constexpr (std::is_same_v<T, std::int64_t>) {
    return reflection.GetInt64(message, &field);
  } else if constexpr (std::is_same_v<T, std::uint64_t>) {
    return reflection.GetUInt64(message, &field);
  } else if constexpr (std::is_same_v<T, std::uint32_t>) {
    return reflection.GetUInt32(message, &field);
  } else {
    return field.cpp_type() == Cpp::CPPTYPE_ENUM ? reflection.GetEnumValue(message, &field)
                                                 : reflection.GetInt32(message, &field);
  }
}

template <typename T>
void set(Message& message, const FieldDescriptor& field, T value) {
  const Reflection& reflection = *message.GetReflection();
  if constexpr (std::is_same_v<T, bool>) {
    reflection.SetBool(&message, &field, value);
  } else if constexpr (std::is_same_v<T, float>) {
    reflection.SetFloat(&message, &field, value);
  } else if constexpr (std::is_same_v<T, double>) {
    reflection.SetDouble(&message, &field, value);
  } else if constexpr (std::is_same_v<T, std::int64_t>) {
    reflection.SetInt64(&message, &field, value);
  } else if constexpr (std::is_same_v<T, std::uint64_t>) {
    reflection.SetUInt64(&message, &field, value);
  } else if constexpr (std::is_same_v<T, std::uint32_t>) {
    reflection.SetUInt32(&message, &field, value);
  } else if (field.cpp_type() == Cpp::CPPTYPE_ENUM) {
    reflection.SetEnumValue(&message, &field, value);
  } else {
    reflection.SetInt32(&message, &field, value);
  }
}

/// None if `To` cannot represent `value`.
template <typename To, typename From>
std::optional<To> converted(From value) {
  if constexpr (std::is_same_v<To, From> || std::is_floating_point_v<To>) {
    return static_cast<To>(value);
  } else if constexpr (std::is_same_v<To, bool>) {
    return value != From{};
  } else if constexpr (std::is_same_v<From, bool>) {
    return static_cast<To>(value ? 1 : 0);
  } else if constexpr (std::is_floating_point_v<From>) {
    // 2^63 and the like are exact as doubles; the largest integer is not.
    const double beyond = std::ldexp(1.0, std::numeric_limits<To>::digits);
    const double rounded = std::nearbyint(static_cast<double>(value));
    if (!(rounded < beyond && rounded >= (std::is_signed_v<To> ? -beyond : 0.0))) {
      return {};
    }
    return static_cast<To>(rounded);
  } else {
    if (!std::in_range<To>(value)) {
      return {};
    }
    return static_cast<To>(value);
  }
}

template <typename To>
std::string range() {
  if constexpr (std::is_integral_v<To> && !std::is_same_v<To, bool>) {
    return fmt::format("a number from {} to {}", std::int64_t{std::numeric_limits<To>::min()},
                       std::uint64_t{std::numeric_limits<To>::max()});
  }
  return "a number";
}

template <typename T>
std::string shown(T value) {
  if constexpr (sizeof(T) == 1) {
    return fmt::format("{}", static_cast<int>(value));
  } else {
    return fmt::format("{}", value);
  }
}

// ---- Values without a counterpart ----

void skip_one(const Field& field, CdrReader& in, const std::string& path);

void skip(const Field& field, CdrReader& in, const std::string& path) {
  if (field.shape == Shape::kOne) {
    skip_one(field, in, path);
    return;
  }
  const std::size_t count =
      field.shape == Shape::kArray ? field.count : in.count(path, least_bytes_of(field));
  if (is_number(field.kind)) {
    (void)in.raw(path, count, size_of(field.kind));
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    skip_one(field, in, path);
  }
}

void skip_one(const Field& field, CdrReader& in, const std::string& path) {
  switch (field.kind) {
    case Kind::kMessage:
      for (const Field& inner : field.message->fields) {
        skip(inner, in, path);
      }
      return;
    case Kind::kText:
      (void)in.view(path);
      return;
    case Kind::kWideText:
      in.fail(path, "a type that is supported", "wstring");
    default:
      (void)in.raw(path, 1, size_of(field.kind));
  }
}

constexpr std::string_view kQuaternion = "geometry_msgs/msg/Quaternion";

void write_zero(const Definition& definition, CdrWriter& out);

void write_zero(const Field& field, CdrWriter& out) {
  if (field.shape == Shape::kSequence || field.shape == Shape::kBoundedSequence) {
    out.count(0);
    return;
  }
  const std::size_t count = field.shape == Shape::kArray ? field.count : 1;
  for (std::size_t i = 0; i < count; ++i) {
    if (field.kind == Kind::kMessage) {
      write_zero(*field.message, out);
    } else if (!is_number(field.kind)) {
      out.text("");
    } else {
      with_number(field.kind, [&]<typename T>(T zero) { out.number(zero); });
    }
  }
}

/// Zeros; for a rotation the identity.
void write_zero(const Definition& definition, CdrWriter& out) {
  const bool is_rotation = definition.name == kQuaternion;
  for (const Field& field : definition.fields) {
    if (is_rotation && field.name == "w") {
      out.number(1.0);
    } else {
      write_zero(field, out);
    }
  }
}

class Skip final : public Step {
 public:
  Skip(const Field& ros, std::string path, std::optional<double> constant)
      : ros_(&ros), path_(std::move(path)), constant_(constant) {}

  void read(CdrReader& in, Message& /*root*/) const override { skip(*ros_, in, path_); }
  void write(const Message& /*root*/, CdrWriter& out) const override {
    if (!constant_ || ros_->shape != Shape::kOne || !is_number(ros_->kind)) {
      write_zero(*ros_, out);
      return;
    }
    with_number(ros_->kind, [&]<typename T>(T /*type*/) {
      const auto value = converted<T>(*constant_);
      if (!value) {
        out.fail(path_, range<T>(), shown(*constant_));
      }
      out.number(*value);
    });
  }

 private:
  const Field* ros_;
  std::string path_;
  std::optional<double> constant_;
};

// ---- Messages ----

class Nested final : public Step {
 public:
  Nested(const Field& ros, Way way, Steps steps)
      : ros_(&ros), way_(std::move(way)), steps_(std::move(steps)) {}

  void read(CdrReader& in, Message& root) const override {
    steps_.read(in, mutable_at(root, way_));
  }
  void write(const Message& root, CdrWriter& out) const override {
    if (!way_.empty() && ros_->message->name == kQuaternion && !is_present(root, way_)) {
      write_zero(*ros_->message, out);
    } else {
      steps_.write(at(root, way_), out);
    }
  }

 private:
  const Field* ros_;
  Way way_;
  Steps steps_;
};

/// Writes the count of a sequence or array.
void write_count(const Field& ros, const std::string& path, std::size_t count, CdrWriter& out) {
  switch (ros.shape) {
    case Shape::kArray:
      if (count != ros.count) {
        out.fail(path, fmt::format("{} elements", ros.count), fmt::format("{}", count));
      }
      return;
    case Shape::kBoundedSequence:
      if (count > ros.count) {
        out.fail(path, fmt::format("at most {} elements", ros.count), fmt::format("{}", count));
      }
      break;
    default:
      break;
  }
  out.count(count, path);
}

/// Reads a count; repeated fields count with int.
std::size_t read_count(const Field& ros, const std::string& path, CdrReader& in) {
  if (ros.shape == Shape::kArray) {
    return ros.count;
  }
  const std::size_t count = in.count(path, least_bytes_of(ros));
  const std::size_t most = ros.shape == Shape::kBoundedSequence ? ros.count : std::size_t{INT_MAX};
  if (count > most) {
    in.fail(path, fmt::format("at most {} elements", most), fmt::format("{}", count));
  }
  return count;
}

class Messages final : public Step {
 public:
  Messages(Pair pair, Steps steps) : pair_(std::move(pair)), steps_(std::move(steps)) {}

  void read(CdrReader& in, Message& root) const override {
    Message& to = mutable_at(root, pair_.way);
    const std::size_t count = read_count(*pair_.ros, pair_.path, in);
    for (std::size_t i = 0; i < count; ++i) {
      steps_.read(in, *to.GetReflection()->AddMessage(&to, pair_.to));
    }
  }
  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    const Reflection& reflection = *from.GetReflection();
    const int count = reflection.FieldSize(from, pair_.to);
    write_count(*pair_.ros, pair_.path, static_cast<std::size_t>(count), out);
    for (int i = 0; i < count; ++i) {
      steps_.write(reflection.GetRepeatedMessage(from, pair_.to, i), out);
    }
  }

 private:
  Pair pair_;
  Steps steps_;
};

// ---- Numbers ----

class Number final : public Step {
 public:
  Number(Pair pair, const Rule& rule)
      : pair_(std::move(pair)),
        scale_(rule.scale),
        offset_(rule.offset),
        is_scaled_(rule.scale != 1.0 || rule.offset != 0.0),
        constant_(rule.constant) {}

  void read(CdrReader& in, Message& root) const override {
    Message& to = mutable_at(root, pair_.way);
    with_number(pair_.ros->kind, [&]<typename T>(T /*type*/) {
      const T value = in.number<T>(pair_.path);
      if (is_scaled_) {
        store(static_cast<double>(value) * scale_ + offset_, to, in);
      } else if (pair_.ros->kind == Kind::kBool) {
        store(value != T{}, to, in);
      } else {
        store(value, to, in);
      }
    });
  }
  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    with_ours(*pair_.to, [&]<typename P>(P /*type*/) {
      const P value = get<P>(from, *pair_.to);
      if (constant_) {
        put(*constant_, out);
      } else if (is_scaled_) {
        put((static_cast<double>(value) - offset_) / scale_, out);
      } else {
        put(value, out);
      }
    });
  }

 private:
  template <typename T>
  void store(T value, Message& to, const CdrReader& in) const {
    with_ours(*pair_.to, [&]<typename P>(P /*type*/) {
      const auto ours = converted<P>(value);
      if (!ours) {
        in.fail(pair_.path, range<P>(), shown(value));
      }
      if constexpr (std::is_same_v<P, std::int32_t>) {
        const google::protobuf::EnumDescriptor* const names = pair_.to->enum_type();
        if (names != nullptr && names->FindValueByNumber(*ours) == nullptr) {
          in.fail(pair_.path, fmt::format("a number of {}", names->full_name()), shown(value));
        }
      }
      set<P>(to, *pair_.to, *ours);
    });
  }
  template <typename P>
  void put(P value, CdrWriter& out) const {
    with_number(pair_.ros->kind, [&]<typename T>(T /*type*/) {
      const auto theirs = converted<T>(value);
      if (!theirs) {
        out.fail(pair_.path, range<T>(), shown(value));
      }
      out.number(*theirs);
    });
  }

  Pair pair_;
  double scale_;
  double offset_;
  bool is_scaled_;
  std::optional<double> constant_;
};

/// Whether both types have the same representation.
template <typename T, typename P>
constexpr bool kIsSame = sizeof(T) == sizeof(P) && !std::is_same_v<P, bool> &&
                         std::is_floating_point_v<T> == std::is_floating_point_v<P> &&
                         std::is_signed_v<T> == std::is_signed_v<P>;

// Protobuf's own alternative sets one number at a time.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
template <typename P>
RepeatedField<P>& mutable_numbers(Message& message, const FieldDescriptor& field) {
  return *message.GetReflection()->MutableRepeatedField<P>(&message, &field);
}

template <typename P>
const RepeatedField<P>& numbers_of(const Message& message, const FieldDescriptor& field) {
  return message.GetReflection()->GetRepeatedField<P>(message, &field);
}
#pragma GCC diagnostic pop

/// Arrays and sequences of numbers: one copy if both have the same kind of number.
class Numbers final : public Step {
 public:
  Numbers(Pair pair, const Rule& rule, std::optional<Way> absent)
      : pair_(std::move(pair)),
        scale_(rule.scale),
        offset_(rule.offset),
        is_scaled_(rule.scale != 1.0 || rule.offset != 0.0),
        absent_(std::move(absent)) {}

  void read(CdrReader& in, Message& root) const override {
    Message& to = mutable_at(root, pair_.way);
    const std::size_t count = read_count(*pair_.ros, pair_.path, in);
    with_number(pair_.ros->kind, [&]<typename T>(T /*type*/) {
      const auto bytes = in.raw(pair_.path, count, sizeof(T));
      with_ours(*pair_.to, [&]<typename P>(P /*type*/) {
        auto& ours = mutable_numbers<P>(to, *pair_.to);
        ours.Reserve(ours.size() + static_cast<int>(count));
        if constexpr (kIsSame<T, P>) {
          if (count > 0 && !is_scaled_) {
            in.copy(bytes.data(), ours.AddNAlreadyReserved(static_cast<int>(count)), count);
            return;
          }
        }
        for (std::size_t i = 0; i < count; ++i) {
          T value;
          in.copy(bytes.data() + i * sizeof(T), &value, 1);
          const auto one = is_scaled_ ? converted<P>(static_cast<double>(value) * scale_ + offset_)
                                      : converted<P>(value);
          if (!one) {
            in.fail(pair_.path, range<P>(), shown(value));
          }
          ours.Add(*one);
        }
      });
    });
  }

  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    with_ours(*pair_.to, [&]<typename P>(P /*type*/) {
      const auto& ours = numbers_of<P>(from, *pair_.to);
      const auto size = static_cast<std::size_t>(ours.size());
      // An array missing in the message is one of zeros.
      if (size == 0 && pair_.ros->shape == Shape::kArray) {
        put_none(absent_ && !is_present(root, *absent_), out);
        return;
      }
      write_count(*pair_.ros, pair_.path, size, out);
      with_number(pair_.ros->kind, [&]<typename T>(T /*type*/) {
        if constexpr (kIsSame<T, P>) {
          if (!is_scaled_) {
            out.array(std::span(ours.data(), size));
            return;
          }
        }
        for (const P value : ours) {
          const auto one = is_scaled_
                               ? converted<T>((static_cast<double>(value) - offset_) / scale_)
                               : converted<T>(value);
          if (!one) {
            out.fail(pair_.path, range<T>(), shown(value));
          }
          out.number(*one);
        }
      });
    });
  }

 private:
  void put_none(bool is_absent, CdrWriter& out) const {
    with_number(pair_.ros->kind, [&]<typename T>(T /*type*/) {
      for (std::size_t i = 0; i < pair_.ros->count; ++i) {
        out.number(is_absent && i == 0 ? static_cast<T>(-1) : T{});
      }
    });
  }

  Pair pair_;
  double scale_;
  double offset_;
  bool is_scaled_;
  std::optional<Way> absent_;
};

/// A number as the value of a key.
class Keyed final : public Step {
 public:
  Keyed(Pair pair, std::string key) : pair_(std::move(pair)), key_(std::move(key)) {
    const google::protobuf::Descriptor& entry = *pair_.to->message_type();
    name_ = entry.FindFieldByName("key");
    value_ = entry.FindFieldByName("value");
  }

  void read(CdrReader& in, Message& root) const override {
    Message& to = mutable_at(root, pair_.way);
    std::string text;
    with_number(pair_.ros->kind,
                [&]<typename T>(T /*type*/) { text = shown(in.number<T>(pair_.path)); });
    Message& entry = *to.GetReflection()->AddMessage(&to, pair_.to);
    entry.GetReflection()->SetString(&entry, name_, key_);
    entry.GetReflection()->SetString(&entry, value_, std::move(text));
  }
  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    const Reflection& reflection = *from.GetReflection();
    std::string text;
    for (int i = 0; i < reflection.FieldSize(from, pair_.to); ++i) {
      const Message& entry = reflection.GetRepeatedMessage(from, pair_.to, i);
      if (entry.GetReflection()->GetString(entry, name_) == key_) {
        text = entry.GetReflection()->GetString(entry, value_);
      }
    }
    with_number(pair_.ros->kind, [&]<typename T>(T /*type*/) {
      T value{};
      if (!text.empty()) {
        double number = 0.0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
        const auto theirs = converted<T>(number);
        if (error != std::errc() || end != text.data() + text.size() || !theirs) {
          out.fail(pair_.path, range<T>(), fmt::format("\"{}\"", text));
        }
        value = *theirs;
      }
      out.number(value);
    });
  }

 private:
  Pair pair_;
  std::string key_;
  const FieldDescriptor* name_ = nullptr;
  const FieldDescriptor* value_ = nullptr;
};

// ---- Texts and bytes ----

class Text final : public Step {
 public:
  Text(Pair pair, const Rule& rule) : pair_(std::move(pair)), ours_(rule.names) {
    for (const auto& [ros, ours] : rule.names) {
      theirs_.emplace(ours, ros);
    }
  }

  void read(CdrReader& in, Message& root) const override {
    Message& to = mutable_at(root, pair_.way);
    const Reflection& reflection = *to.GetReflection();
    const bool is_one = pair_.ros->shape == Shape::kOne;
    const std::size_t count = is_one ? 1 : read_count(*pair_.ros, pair_.path, in);
    for (std::size_t i = 0; i < count; ++i) {
      const std::string_view text = renamed(ours_, in.view(pair_.path));
      if (is_one) {
        reflection.SetString(&to, pair_.to, std::string(text));
      } else {
        reflection.AddString(&to, pair_.to, std::string(text));
      }
    }
  }
  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    const Reflection& reflection = *from.GetReflection();
    std::string scratch;
    if (pair_.ros->shape == Shape::kOne) {
      put(reflection.GetStringReference(from, pair_.to, &scratch), out);
      return;
    }
    const int count = reflection.FieldSize(from, pair_.to);
    write_count(*pair_.ros, pair_.path, static_cast<std::size_t>(count), out);
    for (int i = 0; i < count; ++i) {
      put(reflection.GetRepeatedStringReference(from, pair_.to, i, &scratch), out);
    }
  }

 private:
  using Names = std::map<std::string, std::string, std::less<>>;

  static std::string_view renamed(const Names& names, std::string_view text) {
    const auto found = names.find(text);
    return found == names.end() ? text : std::string_view(found->second);
  }
  void put(std::string_view text, CdrWriter& out) const {
    const std::string_view theirs = renamed(theirs_, text);
    if (pair_.ros->text_max > 0 && theirs.size() > pair_.ros->text_max) {
      out.fail(pair_.path, fmt::format("at most {} bytes", pair_.ros->text_max),
               fmt::format("{}", theirs.size()));
    }
    out.text(theirs, pair_.path);
  }

  Pair pair_;
  Names ours_;
  Names theirs_;
};

/// Arrays and sequences of bytes: one copy.
class Bytes final : public Step {
 public:
  explicit Bytes(Pair pair) : pair_(std::move(pair)) {}

  void read(CdrReader& in, Message& root) const override {
    Message& to = mutable_at(root, pair_.way);
    const std::size_t count = read_count(*pair_.ros, pair_.path, in);
    const auto bytes = in.raw(pair_.path, count, 1);
    to.GetReflection()->SetString(
        &to, pair_.to, std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  }
  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    std::string scratch;
    const std::string& bytes = from.GetReflection()->GetStringReference(from, pair_.to, &scratch);
    if (bytes.empty() && pair_.ros->shape == Shape::kArray) {
      write_zero(*pair_.ros, out);
      return;
    }
    write_count(*pair_.ros, pair_.path, bytes.size(), out);
    out.array(std::span(bytes));
  }

 private:
  Pair pair_;
};

// ---- Times ----

bool is_time(const Field& ros) {
  return ros.kind == Kind::kMessage && ros.shape == Shape::kOne &&
         (ros.message->name == "builtin_interfaces/msg/Time" ||
          ros.message->name == "builtin_interfaces/msg/Duration");
}

/// Seconds and nanoseconds of ROS, as nanoseconds or as a message with seconds and nanos.
class Time final : public Step {
 public:
  explicit Time(Pair pair) : pair_(std::move(pair)) {
    if (const google::protobuf::Descriptor* const type = pair_.to->message_type()) {
      seconds_ = type->FindFieldByName("seconds");
      nanos_ = type->FindFieldByName("nanos");
      is_duration_ = type->full_name() == "google.protobuf.Duration";
    }
  }

  void read(CdrReader& in, Message& root) const override {
    const std::int64_t seconds = in.number<std::int32_t>(pair_.path);
    const std::int64_t time_ns = seconds * kSecond_ns + in.number<std::uint32_t>(pair_.path);
    Message& to = mutable_at(root, pair_.way);
    if (seconds_ == nullptr) {
      set(to, *pair_.to, time_ns);
      return;
    }
    std::int64_t rest_ns = time_ns % kSecond_ns;
    if (rest_ns < 0 && !is_duration_) {
      rest_ns += kSecond_ns;
    }
    Message& time = *to.GetReflection()->MutableMessage(&to, pair_.to);
    set(time, *seconds_, (time_ns - rest_ns) / kSecond_ns);
    set(time, *nanos_, static_cast<std::int32_t>(rest_ns));
  }

  void write(const Message& root, CdrWriter& out) const override {
    const Message& from = at(root, pair_.way);
    std::int64_t seconds = 0;
    std::int64_t rest_ns = 0;
    if (seconds_ == nullptr) {
      rest_ns = get<std::int64_t>(from, *pair_.to);
    } else {
      const Message& time = from.GetReflection()->GetMessage(from, pair_.to);
      seconds = get<std::int64_t>(time, *seconds_);
      rest_ns = get<std::int32_t>(time, *nanos_);
    }
    std::int64_t whole = rest_ns / kSecond_ns;
    rest_ns %= kSecond_ns;
    if (rest_ns < 0) {
      rest_ns += kSecond_ns;
      --whole;
    }
    if (!std::in_range<std::int32_t>(seconds) || !std::in_range<std::int32_t>(seconds + whole)) {
      out.fail(pair_.path, "seconds within 32 bits", fmt::format("{} s and {} s", seconds, whole));
    }
    out.number(static_cast<std::int32_t>(seconds + whole));
    out.number(static_cast<std::uint32_t>(rest_ns));
  }

 private:
  Pair pair_;
  const FieldDescriptor* seconds_ = nullptr;
  const FieldDescriptor* nanos_ = nullptr;
  bool is_duration_ = false;
};

bool takes_time(const FieldDescriptor& to) {
  if (to.is_repeated()) {
    return false;
  }
  if (const google::protobuf::Descriptor* const type = to.message_type()) {
    return type->full_name() == "google.protobuf.Timestamp" ||
           type->full_name() == "google.protobuf.Duration";
  }
  return to.cpp_type() == Cpp::CPPTYPE_INT64;
}

}  // namespace

const Message& at(const Message& root, const Way& way) {
  const Message* message = &root;
  for (const FieldDescriptor* const field : way) {
    message = &message->GetReflection()->GetMessage(*message, field);
  }
  return *message;
}

Message& mutable_at(Message& root, const Way& way) {
  Message* message = &root;
  for (const FieldDescriptor* const field : way) {
    message = message->GetReflection()->MutableMessage(message, field);
  }
  return *message;
}

bool is_present(const Message& root, const Way& way) {
  const Message* message = &root;
  for (const FieldDescriptor* const field : way) {
    if (!message->GetReflection()->HasField(*message, field)) {
      return false;
    }
    message = &message->GetReflection()->GetMessage(*message, field);
  }
  return true;
}

void Steps::read(CdrReader& in, Message& root) const {
  for (const auto& step : steps) {
    step->read(in, root);
  }
  for (const Absent& rule : absent) {
    const Message& of_numbers = at(root, rule.of_numbers);
    const Reflection& reflection = *of_numbers.GetReflection();
    if (reflection.FieldSize(of_numbers, rule.numbers) == 0 ||
        reflection.GetRepeatedDouble(of_numbers, rule.numbers, 0) != -1.0) {
      continue;
    }
    Message& has_numbers = mutable_at(root, rule.of_numbers);
    reflection.ClearField(&has_numbers, rule.numbers);
    Way parent = rule.value;
    parent.pop_back();
    Message& has_value = mutable_at(root, parent);
    has_value.GetReflection()->ClearField(&has_value, rule.value.back());
  }
}

void Steps::write(const Message& root, CdrWriter& out) const {
  for (const auto& step : steps) {
    step->write(root, out);
  }
}

std::unique_ptr<Step> make_skip(const Field& ros, std::string path,
                                std::optional<double> constant) {
  return std::make_unique<Skip>(ros, std::move(path), constant);
}

std::unique_ptr<Step> make_message(const Field& ros, Way way, Steps steps) {
  return std::make_unique<Nested>(ros, std::move(way), std::move(steps));
}

std::unique_ptr<Step> make_messages(Pair pair, Steps steps) {
  return std::make_unique<Messages>(std::move(pair), std::move(steps));
}

std::unique_ptr<Step> make_value(Pair pair, const Rule& rule, const Way* absent) {
  const Field& ros = *pair.ros;
  const FieldDescriptor& to = *pair.to;
  const bool is_one = ros.shape == Shape::kOne;
  if (is_time(ros)) {
    return takes_time(to) ? std::make_unique<Time>(std::move(pair)) : nullptr;
  }
  if (!is_one && size_of(ros.kind) == 1 && to.type() == FieldDescriptor::TYPE_BYTES &&
      !to.is_repeated()) {
    return std::make_unique<Bytes>(std::move(pair));
  }
  if (is_one == to.is_repeated()) {
    return nullptr;
  }
  if (ros.kind == Kind::kText && to.type() == FieldDescriptor::TYPE_STRING) {
    return std::make_unique<Text>(std::move(pair), rule);
  }
  if (!is_number(ros.kind) || !is_number(to)) {
    return nullptr;
  }
  if (is_one) {
    return std::make_unique<Number>(std::move(pair), rule);
  }
  if (to.cpp_type() == Cpp::CPPTYPE_ENUM) {
    return nullptr;
  }
  return std::make_unique<Numbers>(std::move(pair), rule,
                                   absent == nullptr ? std::nullopt : std::optional(*absent));
}

std::unique_ptr<Step> make_keyed(Pair pair, std::string key) {
  if (pair.ros->shape != Shape::kOne || !is_number(pair.ros->kind)) {
    return nullptr;
  }
  return std::make_unique<Keyed>(std::move(pair), std::move(key));
}

}  // namespace fastcycle::ros2
