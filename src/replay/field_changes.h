#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace google::protobuf {
class Message;
}

namespace fastcycle::host {

/// Where two messages differ in one field.
struct ChangePlace {
  std::uint64_t activation = 0;  ///< The one that published the new message.
  std::int64_t time_ns = 0;      ///< Of the activation, since 1970.
  std::uint64_t sequence = 0;    ///< Of the recorded message.
  std::string path = {};         ///< "nominal.points[3].x_m"
  std::string recorded = {};
  std::string now = {};
};

/// How one field of a topic's messages changed.
struct FieldChange {
  std::string field = {};      ///< Of all elements: "nominal.points[].x_m"
  std::uint64_t messages = 0;  ///< With a difference in it.
  std::uint64_t values = 0;    ///< Differing ones, over all these messages.
  std::uint64_t numbers = 0;   ///< Of these, those with a finite change.
  double sum = 0.0;            ///< Of the absolute changes.
  double most = 0.0;           ///< The largest of them.
  ChangePlace first = {};
  ChangePlace largest = {};  ///< Set if `numbers` is not 0.

  /// Mean absolute change; 0 without numbers.
  [[nodiscard]] double mean() const {
    return numbers == 0 ? 0.0 : sum / static_cast<double>(numbers);
  }
};

/// How the messages of one publisher changed.
struct TopicChange {
  std::string topic = {};
  std::string publisher = {};
  std::uint64_t compared = 0;
  std::uint64_t different = 0;
  std::uint64_t missing = 0;  ///< Recorded, but not published.
  std::uint64_t added = 0;    ///< Published, but not recorded.
  /// Of a shadow: too far ahead of what the other side has published, if it publishes at all.
  std::uint64_t not_compared = 0;
  std::vector<FieldChange> fields = {};

  [[nodiscard]] bool is_equal() const { return different + missing + added == 0; }
};

/// How the fields of one publisher's messages changed, by field.
///
/// @threads  By one thread at a time.
class FieldChanges {
 public:
  /// Adds all differences of two messages, which differ in their bytes; `place` identifies them,
  /// without the field.
  void add(const google::protobuf::Message& recorded, const google::protobuf::Message& now,
           const ChangePlace& place);

  /// By number of messages, largest first.
  [[nodiscard]] std::vector<FieldChange> all() const;

 private:
  FieldChange& field_of(const std::string& name);

  std::map<std::string, FieldChange> fields_;
};

}  // namespace fastcycle::host
