#include "inspect/stream.h"

#include <algorithm>
#include <utility>

#include "base/clock.h"
#include "broker/serialized.h"
#include "inspect/elide.h"
#include "inspect/frame.h"
#include "record/descriptor_set.h"

namespace fastcycle::inspect {

bool Excerpts::is_of(const Excerpt& excerpt, const detail::Envelope& envelope) {
  return excerpt.payload == envelope.payload && excerpt.sequence == envelope.info.sequence;
}

const protocol::Message& Excerpts::elided(const detail::Envelope& envelope, std::uint32_t limit) {
  if (is_of(elided_, envelope) && elided_.limit == limit) {
    return elided_.message;
  }
  ElisionLimits limits;
  if (limit != 0) {
    limits.elements = limits.bytes = limit;
    limits.fields = std::max<std::size_t>(limits.fields, limit);
  }
  auto& scratch = scratch_[envelope.payload->GetDescriptor()];
  if (scratch == nullptr) {
    scratch.reset(envelope.payload->New());
  }
  elided_.payload = envelope.payload;
  elided_.sequence = envelope.info.sequence;
  elided_.limit = limit;
  elided_.message.Clear();
  copy_elided(*envelope.payload, *scratch, limits, *elided_.message.mutable_elisions());
  scratch->SerializePartialToString(elided_.message.mutable_payload());
  return elided_.message;
}

const protocol::Message& Excerpts::full(const detail::Envelope& envelope) {
  if (!is_of(full_, envelope)) {
    full_.payload = envelope.payload;
    full_.sequence = envelope.info.sequence;
    full_.message.Clear();
    detail::serialize(*envelope.payload, *full_.message.mutable_payload());
  }
  return full_.message;
}

Stream::~Stream() {
  for (Tap* tap : taps_) {
    tap->remove(*this);
  }
}

void Stream::add(Tap& tap, protocol::Started& started) {
  for (const auto& publisher : tap.topic.publishers) {
    const auto channel = static_cast<std::uint32_t>(channels_.size() + 1);
    channels_[publisher.get()].channel = channel;
    const google::protobuf::Descriptor& type = *publisher->default_instance.GetDescriptor();
    const auto [schema, is_new] =
        schemas_.emplace(type.full_name(), static_cast<std::uint32_t>(schemas_.size()));
    if (is_new) {
      started.add_schemas(record::descriptor_set_of(type));
    }
    protocol::Started::Channel& said = *started.add_channels();
    said.set_channel(channel);
    said.set_topic(tap.topic.name);
    said.set_type(type.full_name());
    said.set_component(publisher->owner.name);
    said.set_publisher(publisher->id);
    said.set_schema(schema->second);
  }
  taps_.push_back(&tap);
}

void Stream::open() {
  for (Tap* tap : taps_) {
    tap->add(*this, options_.content == protocol::Stream::CONTENT_FULL);
  }
}

void Stream::take(const detail::PublisherCore& publisher, const detail::Envelope& envelope) {
  Channel& channel = channels_[&publisher];
  const MessageInfo& info = envelope.info;
  if (channel.last != 0 && info.sequence > channel.last + 1) {
    messages_.set_lost(messages_.lost() + info.sequence - channel.last - 1);
  }
  channel.last = info.sequence;
  if (channel.count++ % options_.every != 0) {
    return;
  }
  if (options_.min_interval_ns > 0) {
    const std::int64_t now_ns = base::monotonic_ns();
    if (now_ns < channel.next_ns) {
      return;
    }
    channel.next_ns = now_ns + options_.min_interval_ns;
  }
  if (room_->left == 0) {
    messages_.set_lost(messages_.lost() + 1);
    return;
  }
  const protocol::Message* excerpt = nullptr;
  if (options_.content == protocol::Stream::CONTENT_ELIDED) {
    excerpt = &excerpts_.elided(envelope, options_.limit);
  } else if (options_.content == protocol::Stream::CONTENT_FULL) {
    excerpt = &excerpts_.full(envelope);
  }
  constexpr std::size_t kAround = 128;
  const std::size_t bytes = (excerpt == nullptr ? 0 : excerpt->ByteSizeLong()) + kAround;
  const bool is_too_large =
      bytes > kMaxAnswerBytes / 2;  // For a frame, whatever the client's limits.
  if (is_too_large || bytes > room_->left || bytes > common_room_->left) {
    common_room_->was_too_small |= !is_too_large && bytes > common_room_->left;
    messages_.set_lost(messages_.lost() + 1);
    return;
  }
  room_->left -= bytes;
  common_room_->left -= bytes;
  protocol::Message& message = *messages_.add_messages();
  if (excerpt != nullptr) {
    message = *excerpt;
  }
  message.set_channel(channel.channel);
  message.set_sequence(info.sequence);
  message.set_publish_time_ns(base::to_ns(info.publish_time));
  message.set_taken_ns(base::to_ns(info.origin.taken));
  message.set_root(info.origin.root);
  message.set_held(info.origin.held);
  if (options_.with_size) {
    message.set_bytes(options_.content == protocol::Stream::CONTENT_FULL
                          ? message.payload().size()
                          : detail::serialized_size(*envelope.payload));
  }
}

bool Stream::collect(protocol::Answer& answer) {
  if (messages_.messages().empty() && messages_.lost() == 0) {
    return false;
  }
  answer.set_id(id);
  messages_.Swap(answer.mutable_messages());
  messages_.Clear();
  return true;
}

}  // namespace fastcycle::inspect
