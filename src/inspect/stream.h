#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "inspect/inspect.pb.h"
#include "inspect/taps.h"

namespace fastcycle::inspect {

/// Converted forms of one message, shared by all streams that request the same form.
///
/// @threads  Confined.
class Excerpts {
 public:
  /// The message with its long fields cut to `limit` elements, bytes or letters; 0: 16 and 64.
  const protocol::Message& elided(const detail::Envelope& envelope, std::uint32_t limit);
  const protocol::Message& full(const detail::Envelope& envelope);

 private:
  struct Excerpt {
    const google::protobuf::Message* payload = nullptr;
    std::uint64_t sequence = 0;
    std::uint32_t limit = 0;
    protocol::Message message;
  };

  static bool is_of(const Excerpt& excerpt, const detail::Envelope& envelope);

  Excerpt elided_;
  Excerpt full_;
  std::map<const google::protobuf::Descriptor*, std::unique_ptr<google::protobuf::Message>>
      scratch_;
};

/// Bytes that may still be queued for slow readers: for one client, or for all together.
struct Room {
  std::size_t left = 0;
  bool was_too_small = false;  ///< A message was lost for lack of room.
};

/// Messages of one or many topics on their way to one client.
///
/// @threads  Confined to the server's thread.
class Stream final : public TapUser {
 public:
  /// Content of each message that is sent, and the rate.
  struct Options {
    protocol::Stream::Content content = protocol::Stream::CONTENT_ELIDED;
    std::uint32_t every = 1;
    std::int64_t min_interval_ns = 0;
    std::uint32_t limit = 0;
    bool with_size = false;
  };

  Stream(std::uint32_t its_id, Options options, Excerpts& excerpts)
      : id(its_id), options_(options), excerpts_(excerpts) {}
  ~Stream() override;

  /// Adds `tap`'s topic. Before `open`.
  void add(Tap& tap, protocol::Started& started);
  /// Starts the delivery of messages.
  void open();

  void take(const detail::PublisherCore& publisher, const detail::Envelope& envelope) override;

  /// Sets the limits for queued messages, of this client and of all clients, before each poll. Both
  /// are valid until that poll ends.
  void allow(Room& of_client, Room& of_all) noexcept {
    room_ = &of_client;
    common_room_ = &of_all;
  }
  /// Messages since the last call; false if there are none.
  [[nodiscard]] bool collect(protocol::Answer& answer);

  const std::uint32_t id;

 private:
  struct Channel {
    std::uint32_t channel = 0;
    std::uint64_t last = 0;   ///< Sequence of the last message received.
    std::uint64_t count = 0;  ///< Messages received.
    std::int64_t next_ns = 0;
  };

  const Options options_;
  Excerpts& excerpts_;
  std::vector<Tap*> taps_;
  std::map<const detail::PublisherCore*, Channel> channels_;
  std::map<std::string, std::uint32_t> schemas_;  ///< By type.
  Room* room_ = nullptr;
  Room* common_room_ = nullptr;
  protocol::Messages messages_;
};

}  // namespace fastcycle::inspect
