#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::web {

/// What a request says of who sends it.
struct Caller {
  std::string_view target;         ///< Path and query.
  std::string_view host;           ///< The header `Host`,
  std::string_view origin;         ///< `Origin`,
  std::string_view authorization;  ///< and `Authorization`; each empty if it is missing.
};

/// Who may look.
struct Access {
  std::string token;
  std::vector<std::string> origins;  ///< Pages of others from which it may be asked.
  std::vector<std::string> hosts;    ///< Names by which it may be called, beside IP addresses.
};

/// Why `caller` is refused; empty if it is not. A page of another site that a browser shows knows
/// no token, but may have the browser send requests here: by the address (then its `Origin` is
/// another one), or by a name of its own that leads here (then `Host` is that name).
[[nodiscard]] std::string find_refusal(const Access& access, const Caller& caller);

/// 128 random bits, as 32 hexadecimal digits.
[[nodiscard]] std::string make_token();

/// Whether `text` may be a token: 32 to 256 letters, digits, - and _.
[[nodiscard]] bool is_token(std::string_view text);

/// Whether both are the same, in a time that tells nothing of where they differ.
[[nodiscard]] bool is_same_secret(std::string_view a, std::string_view b) noexcept;

/// The value of `name` in the query of `target`; empty if there is none.
[[nodiscard]] std::string_view query_value(std::string_view target, std::string_view name);

}  // namespace fastcycle::web
