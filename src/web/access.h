#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::web {

/// The parts of a request that identify its sender.
struct Caller {
  std::string_view target;         ///< Path and query.
  std::string_view host;           ///< The header `Host`,
  std::string_view origin;         ///< `Origin`,
  std::string_view authorization;  ///< and `Authorization`; each empty if it is missing.
};

/// Access control of the server.
struct Access {
  std::string token;
  std::vector<std::string> origins;  ///< Other origins whose pages may send requests.
  std::vector<std::string> hosts;    ///< Permitted host names, beside IP addresses.
};

/// Why `caller` is refused; empty if it is not. A page of another site has no token, but may have
/// the browser send requests here: by address (then its `Origin` differs), or by a name of its own
/// that resolves to this machine (then `Host` is that name).
[[nodiscard]] std::string find_refusal(const Access& access, const Caller& caller);

/// 128 random bits, as 32 hexadecimal digits.
[[nodiscard]] std::string make_token();

/// Whether `text` is a valid token: 32 to 256 letters, digits, - and _.
[[nodiscard]] bool is_token(std::string_view text);

/// Whether both are equal, compared in constant time.
[[nodiscard]] bool is_same_secret(std::string_view a, std::string_view b) noexcept;

/// The value of `name` in the query of `target`; empty if there is none.
[[nodiscard]] std::string_view query_value(std::string_view target, std::string_view name);

}  // namespace fastcycle::web
