#include "archive/view_data.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include "archive/message_type.h"

namespace fastcycle::archive {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;
using Json = nlohmann::ordered_json;

constexpr double kNsPerSecond = 1e9;
constexpr int kTimeDecimals = 4;

// ---- Its picks, found in a message type ----

struct Bound {
  const Pick* pick = nullptr;
  std::vector<const Field*> way;  ///< From the message to the field.
  std::vector<Bound> fields;

  [[nodiscard]] const Field& field() const { return *way.back(); }
};

std::vector<Bound> bind(const std::vector<Pick>& picks, const pb::Descriptor& type);

Bound bind(const Pick& pick, const pb::Descriptor& type) {
  Bound bound{.pick = &pick, .way = {}, .fields = {}};
  const pb::Descriptor* within = &type;
  for (const std::string& name : pick.path) {
    const bool is_in_one =
        within != nullptr && (bound.way.empty() || !bound.way.back()->is_repeated());
    const Field* const field = is_in_one ? within->FindFieldByName(name) : nullptr;
    if (field == nullptr) {
      throw std::runtime_error(
          fmt::format("{} has no field {}", type.full_name(), fmt::join(pick.path, ".")));
    }
    bound.way.push_back(field);
    within = field->message_type();
  }
  const auto expect = [&](bool is_so, const char* what) {
    if (!is_so) {
      throw std::runtime_error(
          fmt::format("{} of {} is no {}", fmt::join(pick.path, "."), type.full_name(), what));
    }
  };
  const Field& field = bound.field();
  expect((within != nullptr) == !pick.fields.empty(),
         pick.fields.empty() ? "single value" : "message");
  expect(!pick.is_time || field.cpp_type() == Field::CPPTYPE_INT64, "time: a number of 64 bits");
  expect(pick.points.has_value() == (field.type() == Field::TYPE_BYTES),
         pick.points ? "field of bytes" : "value that can be shown");
  if (within != nullptr) {
    bound.fields = bind(pick.fields, *within);
  }
  return bound;
}

std::vector<Bound> bind(const std::vector<Pick>& picks, const pb::Descriptor& type) {
  std::vector<Bound> bound;
  bound.reserve(picks.size());
  for (const Pick& pick : picks) {
    bound.push_back(bind(pick, type));
  }
  return bound;
}

// ---- Its values ----

void add_number(double value, int decimals, std::string& text) {
  if (!std::isfinite(value)) {
    text += "null";
    return;
  }
  const std::size_t before = text.size();
  fmt::format_to(std::back_inserter(text), "{:.{}f}", value, decimals);
  if (decimals > 0) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') {
      text.pop_back();
    }
  }
  if (std::string_view(text).substr(before) == "-0") {
    text.erase(before, 1);
  }
}

/// So that it may stand in a page.
void add_json(const Json& json, std::string& text) {
  for (const char letter : json.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (letter == '<') {
      text += "\\u003c";
    } else {
      text += letter;
    }
  }
}

void add_text(const std::string& value, std::string& text) {
  add_json(value, text);
}

void add_base64(const std::vector<std::uint8_t>& bytes, std::string& text) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      group = group << 8U | (j < count ? bytes[i + j] : 0U);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      text += j <= count ? kLetters[group >> (18U - 6U * j) & 63U] : '=';
    }
  }
}

template <typename T>
T read(std::string_view bytes, std::size_t offset) {
  static_assert(std::endian::native == std::endian::little);
  T value{};
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

/// Points, thinned: of each x, y and z in centimetres and the time, 16 bits each, as base64.
class ThinnedPoints {
 public:
  /// Of `most` points a message.
  ThinnedPoints(const PointLayout& layout, std::uint64_t most) : layout_(layout), most_(most) {}

  void add(std::string_view bytes, std::string& text) const {
    std::vector<std::size_t> there;
    for (std::size_t at = 0; at + layout_.stride <= bytes.size(); at += layout_.stride) {
      if (is_there(bytes, at)) {
        there.push_back(at);
      }
    }
    const std::size_t step = std::max<std::size_t>(1, (there.size() + most_ - 1) / most_);
    std::vector<std::uint8_t> packed;
    for (std::size_t i = 0; i < there.size(); i += step) {
      for (const std::size_t offset : {layout_.x, layout_.y, layout_.z}) {
        const auto cm =
            static_cast<std::int16_t>(std::lround(kCmPerM * read<float>(bytes, there[i] + offset)));
        put(static_cast<std::uint16_t>(cm), packed);
      }
      put(layout_.time ? read<std::uint16_t>(bytes, there[i] + *layout_.time) : std::uint16_t{0},
          packed);
    }
    text += '"';
    add_base64(packed, text);
    text += '"';
  }

 private:
  static constexpr float kCmPerM = 100.0F;
  static constexpr float kFarthestM = 327.0F;

  /// Not at the origin, which stands for no echo; and near enough for 16 bits.
  [[nodiscard]] bool is_there(std::string_view bytes, std::size_t at) const {
    bool is_near = true;
    bool is_apart = false;
    for (const std::size_t offset : {layout_.x, layout_.y, layout_.z}) {
      const auto value = read<float>(bytes, at + offset);
      is_near = is_near && std::abs(value) < kFarthestM;
      is_apart = is_apart || value != 0.0F;
    }
    return is_near && is_apart;
  }

  static void put(std::uint16_t value, std::vector<std::uint8_t>& packed) {
    packed.push_back(static_cast<std::uint8_t>(value & 0xFFU));
    packed.push_back(static_cast<std::uint8_t>(value >> 8U));
  }

  const PointLayout& layout_;
  const std::uint64_t most_;
};

/// Writes the picked values of messages of one layer.
class Values {
 public:
  Values(std::uint64_t begin_ns, std::uint64_t messages)
      : begin_ns_(begin_ns), messages_(std::max<std::uint64_t>(1, messages)) {}

  void add_all(const pb::Message& message, const std::vector<Bound>& fields,
               std::string& text) const {
    for (const Bound& bound : fields) {
      text += ',';
      add(message, bound, text);
    }
  }
  void add_time(std::int64_t time_ns, std::string& text) const {
    // A file may have any time: unsigned subtraction is always defined.
    const std::uint64_t since_ns = static_cast<std::uint64_t>(time_ns) - begin_ns_;
    add_number(static_cast<double>(static_cast<std::int64_t>(since_ns)) / kNsPerSecond,
               kTimeDecimals, text);
  }

 private:
  void add(const pb::Message& message, const Bound& bound, std::string& text) const {
    const pb::Message* within = &message;
    for (std::size_t i = 0; i + 1 < bound.way.size(); ++i) {
      if (!within->GetReflection()->HasField(*within, bound.way[i])) {
        text += "null";
        return;
      }
      within = &within->GetReflection()->GetMessage(*within, bound.way[i]);
    }
    if (!bound.field().is_repeated()) {
      add_one(*within, bound, -1, text);
      return;
    }
    text += '[';
    const int size = within->GetReflection()->FieldSize(*within, &bound.field());
    for (int i = 0; i < size; i += bound.pick->every) {
      text += i == 0 ? "" : ",";
      add_one(*within, bound, i, text);
    }
    text += ']';
  }

  /// The field; of a repeated one, the element at `index`.
  void add_one(const pb::Message& message, const Bound& bound, int index, std::string& text) const {
    const Field* const field = &bound.field();
    const pb::Reflection& reflection = *message.GetReflection();
    const bool is_one = index < 0;
    switch (field->cpp_type()) {
      case Field::CPPTYPE_MESSAGE:
        if (is_one && !reflection.HasField(message, field)) {
          text += "null";
          return;
        }
        add_message(is_one ? reflection.GetMessage(message, field)
                           : reflection.GetRepeatedMessage(message, field, index),
                    bound, text);
        return;
      case Field::CPPTYPE_STRING:
        add_string(is_one ? reflection.GetString(message, field)
                          : reflection.GetRepeatedString(message, field, index),
                   *bound.pick, text);
        return;
      case Field::CPPTYPE_ENUM:
        add_text((is_one ? reflection.GetEnum(message, field)
                         : reflection.GetRepeatedEnum(message, field, index))
                     ->name(),
                 text);
        return;
      case Field::CPPTYPE_INT64: {
        const std::int64_t value = is_one ? reflection.GetInt64(message, field)
                                          : reflection.GetRepeatedInt64(message, field, index);
        if (bound.pick->is_time) {
          add_time(value, text);
        } else {
          text += std::to_string(value);
        }
        return;
      }
      case Field::CPPTYPE_UINT64:
        text += std::to_string(is_one ? reflection.GetUInt64(message, field)
                                      : reflection.GetRepeatedUInt64(message, field, index));
        return;
      default:
        add_number(small_number(message, *field, index), bound.pick->decimals, text);
    }
  }

  static double small_number(const pb::Message& message, const Field& field, int index) {
    const pb::Reflection& reflection = *message.GetReflection();
    const bool is_one = index < 0;
    switch (field.cpp_type()) {
      case Field::CPPTYPE_DOUBLE:
        return is_one ? reflection.GetDouble(message, &field)
                      : reflection.GetRepeatedDouble(message, &field, index);
      case Field::CPPTYPE_FLOAT:
        return is_one ? reflection.GetFloat(message, &field)
                      : reflection.GetRepeatedFloat(message, &field, index);
      case Field::CPPTYPE_INT32:
        return is_one ? reflection.GetInt32(message, &field)
                      : reflection.GetRepeatedInt32(message, &field, index);
      case Field::CPPTYPE_UINT32:
        return is_one ? reflection.GetUInt32(message, &field)
                      : reflection.GetRepeatedUInt32(message, &field, index);
      default:
        return (is_one ? reflection.GetBool(message, &field)
                       : reflection.GetRepeatedBool(message, &field, index))
                   ? 1.0
                   : 0.0;
    }
  }

  void add_message(const pb::Message& message, const Bound& bound, std::string& text) const {
    const std::size_t before = text.size();
    add_all(message, bound.fields, text);
    text[before] = '[';  // In the place of the first comma.
    text += ']';
  }

  void add_string(const std::string& value, const Pick& pick, std::string& text) const {
    if (!pick.points) {
      add_text(value, text);
      return;
    }
    const std::uint64_t most = std::max<std::uint64_t>(1, pick.points->most / messages_);
    ThinnedPoints(*pick.points, most).add(value, text);
  }

  const std::uint64_t begin_ns_;
  const std::uint64_t messages_;  ///< Of the layer, in the whole log.
};

// ---- The log ----

using Files = std::span<const mcap::Reader* const>;

/// The messages of a topic, as the log counts them.
std::uint64_t messages_of(Files files, const std::string& topic) {
  std::uint64_t messages = 0;
  for (const mcap::Reader* const file : files) {
    const auto& counts = file->statistics()->channel_message_counts;
    for (const auto& [id, channel] : file->definitions().channels()) {
      const auto count = counts.find(id);
      messages += channel.topic == topic && count != counts.end() ? count->second : 0;
    }
  }
  return messages;
}

/// The messages of all files that a query selects, by log time.
class MergedMessages {
 public:
  struct Next {
    std::size_t file = 0;
    mcap::StoredMessage message;
  };

  MergedMessages(Files files, const mcap::MessageQuery& query) {
    for (const mcap::Reader* const file : files) {
      sources_.push_back(file->messages(query));
      heads_.push_back(sources_.back().next());
    }
  }

  /// Its data is valid until the next call.
  std::optional<Next> next() {
    if (last_) {
      heads_[*last_] = sources_[*last_].next();
    }
    last_.reset();
    for (std::size_t file = 0; file < heads_.size(); ++file) {
      if (heads_[file] && (!last_ || heads_[file]->log_time_ns < heads_[*last_]->log_time_ns)) {
        last_ = file;
      }
    }
    return last_ ? std::optional(Next{.file = *last_, .message = *heads_[*last_]}) : std::nullopt;
  }

 private:
  std::vector<mcap::MessageReader> sources_;
  std::vector<std::optional<mcap::StoredMessage>> heads_;
  std::optional<std::size_t> last_;  ///< The file of the message that was returned last.
};

/// One file: its definitions, and the types of its schemas.
struct File {
  const mcap::Reader& reader;
  MessageTypes types = {};
};

/// The selected data of one layer.
class LayerData {
 public:
  LayerData(const Layer& layer, Files files, std::uint64_t begin_ns)
      : layer_(layer), values_(begin_ns, messages_of(files, layer.topic)) {}

  void take(const mcap::StoredMessage& message, File& file) {
    const auto time_ns = static_cast<double>(message.publish_time_ns);
    // A little less than the period: messages come at times that are not exact.
    if (time_ns < next_ns_ - layer_.least_period_ns / 10.0) {
      return;
    }
    const std::size_t before = messages_.size();
    try {
      const MessageType& type = type_of(*message.channel, file);
      const auto parsed = type.parse(message.data);
      messages_ += count_ == 0 ? "[" : ",\n[";
      values_.add_time(static_cast<std::int64_t>(message.publish_time_ns), messages_);
      values_.add_all(*parsed, fields_of(type), messages_);
      messages_ += ']';
    } catch (const std::runtime_error& error) {
      messages_.erase(before);
      if (unreadable_++ == 0) {
        problem_ = error.what();
      }
      return;
    }
    ++count_;
    next_ns_ = time_ns + layer_.least_period_ns;
  }

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::size_t bytes() const { return messages_.size(); }
  [[nodiscard]] const std::string& topic() const { return layer_.topic; }

  /// Why it is not, or not all of it, in the page.
  [[nodiscard]] std::string left_out() const {
    if (unreadable_ == 0 && count_ > 0) {
      return {};
    }
    const std::string some = count_ > 0 ? fmt::format("{} message{}, the first: ", unreadable_,
                                                      unreadable_ == 1 ? "" : "s")
                                        : "";
    return fmt::format("{} ({}): {}{}", layer_.name, layer_.topic, some,
                       unreadable_ == 0 ? "no messages" : problem_);
  }

  void write(std::string& json) const {
    add_text(layer_.name, json);
    json += ":{\"topic\":";
    add_text(layer_.topic, json);
    json += ",\"names\":";
    add_names(layer_.fields, json);
    json += ",\"messages\":[" + messages_ + "]}";
  }

 private:
  static const MessageType& type_of(const mcap::Channel& channel, File& file) {
    if (channel.message_encoding != "protobuf") {
      throw std::runtime_error("its messages are no protobuf");
    }
    const mcap::Schema* const schema = file.reader.definitions().find_schema(channel.schema_id);
    if (schema == nullptr) {
      throw std::runtime_error("it has no schema");
    }
    const MessageTypes::Found& found = file.types.find(*schema);
    if (found.type == nullptr) {
      throw std::runtime_error(found.problem);
    }
    return *found.type;
  }

  const std::vector<Bound>& fields_of(const MessageType& type) {
    const auto known = bound_.find(&type);
    return known != bound_.end()
               ? known->second
               : bound_.emplace(&type, bind(layer_.fields, type.descriptor())).first->second;
  }

  static void add_names(const std::vector<Pick>& fields, std::string& json) {
    json += '[';
    for (const Pick& pick : fields) {
      json += &pick == &fields.front() ? "" : ",";
      if (pick.fields.empty()) {
        add_text(pick.name, json);
        continue;
      }
      json += '[';
      add_text(pick.name, json);
      json += ',';
      add_names(pick.fields, json);
      json += ']';
    }
    json += ']';
  }

  const Layer& layer_;
  const Values values_;
  std::map<const MessageType*, std::vector<Bound>> bound_;
  double next_ns_ = 0.0;
  std::uint64_t count_ = 0;
  std::string messages_;
  std::uint64_t unreadable_ = 0;
  std::string problem_;  ///< Of the first of these.
};

/// Gives a message to its layers.
void take(const mcap::StoredMessage& message, std::vector<LayerData>& data, File& file,
          std::uint64_t most_bytes) {
  std::uint64_t size = 0;
  for (LayerData& layer : data) {
    if (layer.topic() == message.channel->topic) {
      layer.take(message, file);
    }
    size += layer.bytes();
  }
  if (size > most_bytes) {
    throw std::runtime_error(
        fmt::format("more than {} MiB would be needed; choose a part of the log by --start and "
                    "--end, or less of it by --view",
                    most_bytes >> 20U));
  }
}

/// The topics that a view could use instead.
std::string topics_of(Files files) {
  constexpr std::size_t kMostNames = 8;
  std::set<std::string> topics;
  for (const mcap::Reader* const file : files) {
    for (const auto& [id, channel] : file->definitions().channels()) {
      // Neither what FastCycle publishes itself, nor services and key frames.
      if (!channel.topic.starts_with("fastcycle/") &&
          channel.topic.find('#') == std::string::npos) {
        topics.insert(channel.topic);
      }
    }
  }
  std::string names;
  std::size_t count = 0;
  for (const std::string& topic : topics) {
    if (count++ < kMostNames) {
      names += (names.empty() ? "" : ", ") + topic;
    }
  }
  return fmt::format("the log has {}{} (--view names topics and fields to draw)",
                     names.empty() ? "no topics" : names, count > kMostNames ? ", …" : "");
}

}  // namespace

std::uint64_t first_message_ns(std::span<const mcap::Reader* const> files) {
  std::uint64_t first_ns = std::numeric_limits<std::uint64_t>::max();
  for (const mcap::Reader* const file : files) {
    const mcap::Statistics& statistics = *file->statistics();
    if (statistics.message_count > 0) {
      first_ns = std::min(first_ns, statistics.message_start_time_ns);
    }
  }
  return first_ns == std::numeric_limits<std::uint64_t>::max() ? 0 : first_ns;
}

ViewData view_data(std::span<const mcap::Reader* const> files, std::string_view view,
                   const ViewOptions& options, std::uint64_t bytes, const Progress& progress) {
  const auto [constants, layers] = parse_view(view);
  std::uint64_t last_ns = 0;
  for (const mcap::Reader* const file : files) {
    last_ns = std::max(last_ns, file->statistics()->message_end_time_ns);
  }
  const std::uint64_t begin_ns = std::max(options.begin_ns, first_message_ns(files));
  const std::uint64_t end_ns =
      std::min(options.end_ns.value_or(std::numeric_limits<std::uint64_t>::max()), last_ns);
  if (begin_ns > end_ns) {
    throw std::runtime_error("there is nothing to draw: the log ends before that");
  }
  const double span_ns = std::max(1.0, static_cast<double>(end_ns - begin_ns));
  const std::uint64_t zero_ns = options.zero_ns.value_or(begin_ns);

  std::vector<LayerData> data;
  mcap::MessageQuery before{.topics = {}, .begin_ns = 0, .end_ns = begin_ns};
  mcap::MessageQuery query{.topics = {}, .begin_ns = begin_ns, .end_ns = options.end_ns};
  for (const Layer& layer : layers) {
    data.emplace_back(layer, files, zero_ns);
    query.topics.push_back(layer.topic);
    if (layer.is_latched) {
      before.topics.push_back(layer.topic);
    }
  }
  std::vector<File> all;
  for (const mcap::Reader* const file : files) {
    all.push_back({.reader = *file});
  }
  const auto take_all = [&](const mcap::MessageQuery& selected) {
    MergedMessages messages(files, selected);
    while (const std::optional<MergedMessages::Next> next = messages.next()) {
      take(next->message, data, all[next->file], options.most_bytes);
      const double since_ns =
          static_cast<double>(next->message.log_time_ns) - static_cast<double>(begin_ns);
      if (progress) {
        progress(static_cast<std::uint64_t>(static_cast<double>(bytes) *
                                            std::clamp(since_ns / span_ns, 0.0, 1.0)));
      }
    }
  };
  if (!before.topics.empty()) {
    take_all(before);
  }
  take_all(query);

  ViewData result;
  result.json = fmt::format("{{\"begin_ns\":\"{}\",\"duration\":", zero_ns);
  add_number((static_cast<double>(end_ns) - static_cast<double>(zero_ns)) / kNsPerSecond,
             kTimeDecimals, result.json);
  result.json += ",\"constants\":";
  add_json(constants, result.json);
  result.json += ",\"layers\":{";
  bool is_first = true;
  for (const LayerData& layer : data) {
    if (std::string left_out = layer.left_out(); !left_out.empty()) {
      result.left_out.push_back(std::move(left_out));
    }
    if (layer.count() > 0) {
      result.messages += layer.count();
      result.json += is_first ? "" : ",\n";
      layer.write(result.json);
      is_first = false;
    }
  }
  result.json += "}}";
  if (is_first && !options.may_be_empty) {
    throw std::runtime_error(fmt::format("there is nothing to draw: {}; {}", topics_of(files),
                                         fmt::join(result.left_out, "; ")));
  }
  return result;
}

}  // namespace fastcycle::archive
