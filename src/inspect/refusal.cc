#include "inspect/refusal.h"

namespace fastcycle::inspect {

void Refusal::fill(protocol::Error& error) const {
  error.set_kind(kind_);
  error.set_text(to_utf8(what()));
  error.set_hint(to_utf8(hint_));
  error.set_allow(allow_);
}

protocol::Answer error_answer(std::uint32_t id, const Refusal& refusal) {
  protocol::Answer answer;
  answer.set_id(id);
  refusal.fill(*answer.mutable_error());
  return answer;
}

}  // namespace fastcycle::inspect
