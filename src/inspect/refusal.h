#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// Why a request is not answered as it was meant.
class Refusal : public std::runtime_error {
 public:
  Refusal(protocol::Error::Kind kind, const std::string& text, std::string hint = {},
          std::string allow = {})
      : std::runtime_error(text), kind_(kind), hint_(std::move(hint)), allow_(std::move(allow)) {}

  void fill(protocol::Error& error) const;
  /// Whether the connection does.
  [[nodiscard]] bool goes_on() const {
    return kind_ != protocol::Error::KIND_MALFORMED && kind_ != protocol::Error::KIND_VERSION;
  }

 private:
  protocol::Error::Kind kind_;
  std::string hint_;
  std::string allow_;
};

[[nodiscard]] protocol::Answer error_answer(std::uint32_t id, const Refusal& refusal);

/// What is no UTF-8 is shown as '?': a text of a message has to be.
[[nodiscard]] std::string to_utf8(std::string_view text);

}  // namespace fastcycle::inspect
