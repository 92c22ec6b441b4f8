#include "inspect/refusal.h"

#include <algorithm>

#include "config/parse.h"

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

std::string to_utf8(std::string_view text) {
  std::string result(text);
  if (!config::is_utf8(result)) {
    std::ranges::replace_if(
        result, [](char c) { return (static_cast<unsigned char>(c) & 0x80U) != 0; }, '?');
  }
  return result;
}

}  // namespace fastcycle::inspect
