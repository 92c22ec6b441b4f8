#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/utf8.h"
#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// The reason why a request is refused.
class Refusal : public std::runtime_error {
 public:
  Refusal(protocol::Error::Kind kind, const std::string& text, std::string hint = {},
          std::string allow = {})
      : std::runtime_error(text), kind_(kind), hint_(std::move(hint)), allow_(std::move(allow)) {}

  void fill(protocol::Error& error) const;
  /// Whether the connection stays open.
  [[nodiscard]] bool goes_on() const {
    return kind_ != protocol::Error::KIND_MALFORMED && kind_ != protocol::Error::KIND_VERSION;
  }

 private:
  protocol::Error::Kind kind_;
  std::string hint_;
  std::string allow_;
};

[[nodiscard]] protocol::Answer error_answer(std::uint32_t id, const Refusal& refusal);

using base::to_utf8;

}  // namespace fastcycle::inspect
