#include "record/message_infos.h"

#include <limits>

#include "log/log.pb.h"
#include "record/descriptor_set.h"

namespace fastcycle::record {
namespace {

bool is_root(const MessageFacts& message) {
  return message.root == 0 || message.root == message.publisher;
}

}  // namespace

bool MessageFacts::are_needed() const {
  return age_ns != 0 || !is_root(*this) || held ||
         sequence > std::numeric_limits<std::uint32_t>::max();
}

mcap::Schema infos_schema(std::uint16_t id) {
  const google::protobuf::Descriptor& type = *log::MessageInfos::descriptor();
  return {
      .id = id, .name = type.full_name(), .encoding = "protobuf", .data = descriptor_set_of(type)};
}

std::string infos_of(std::span<const MessageFacts> messages) {
  log::MessageInfos infos;
  for (const MessageFacts& message : messages) {
    if (message.are_needed()) {
      log::MessageInfo& info = *infos.add_infos();
      info.set_channel(message.channel);
      info.set_sequence(message.sequence);
      info.set_age_ns(message.age_ns);
      info.set_root(is_root(message) ? 0 : message.root);
      info.set_held(message.held);
    }
  }
  return infos.SerializeAsString();
}

}  // namespace fastcycle::record
