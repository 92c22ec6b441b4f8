#include "dds_gateway/engine.h"

#include <fmt/format.h>

namespace fastcycle::dds_gateway {

#ifdef FASTCYCLE_HAS_CYCLONE
std::unique_ptr<Participant> create_cyclone(const ParticipantOptions& options);
#endif
#ifdef FASTCYCLE_HAS_FAST
std::unique_ptr<Participant> create_fast(const ParticipantOptions& options);
#endif

std::span<const Engine> engines() {
  static constexpr Engine kEngines[] = {
#ifdef FASTCYCLE_HAS_CYCLONE
      {.name = "cyclone", .create = create_cyclone},
#endif
#ifdef FASTCYCLE_HAS_FAST
      {.name = "fast", .create = create_fast},
#endif
  };
  return kEngines;
}

std::string refusal_of_security(const Endpoint& endpoint) {
  return fmt::format(
      "{}: security refuses to {} it: expected <topic>{}</topic> under <{}> in the permissions of "
      "this participant (permissions.p7s), for its domain",
      endpoint.topic, endpoint.is_reader ? "read" : "write", endpoint.topic,
      endpoint.is_reader ? "subscribe" : "publish");
}

std::string to_text(const Qos& qos) {
  return fmt::format("{}, {}", qos.is_reliable ? "reliable" : "best effort",
                     qos.is_transient_local ? "transient local" : "volatile");
}

std::optional<std::string> mismatch(const Qos& reader, const Qos& writer) {
  if (reader.is_reliable && !writer.is_reliable) {
    return "the reader asks for reliable, the writer offers best effort";
  }
  if (reader.is_transient_local && !writer.is_transient_local) {
    return "the reader asks for transient local, the writer offers volatile";
  }
  return {};
}

}  // namespace fastcycle::dds_gateway
