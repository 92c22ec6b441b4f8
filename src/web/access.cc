#include "web/access.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <stdexcept>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/random.h>

namespace fastcycle::web {
namespace {

/// `host` without its port.
std::string_view name_of(std::string_view host) {
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    return end == std::string_view::npos ? host : host.substr(0, end + 1);
  }
  return host.substr(0, host.find(':'));
}

bool is_address(std::string_view name) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  if (name.size() > 2 && name.front() == '[' && name.back() == ']') {
    const std::string text(name.substr(1, name.size() - 2));
    return ::inet_pton(AF_INET6, text.c_str(), bytes.data()) == 1;
  }
  return ::inet_pton(AF_INET, std::string(name).c_str(), bytes.data()) == 1;
}

}  // namespace

std::string find_refusal(const Access& access, const Caller& caller) {
  const std::string_view name = name_of(caller.host);
  if (!is_address(name) && name != "localhost" &&
      std::ranges::find(access.hosts, name) == access.hosts.end()) {
    return fmt::format("this server is not called \"{}\": use its IP address, or localhost",
                       name.substr(0, 64));
  }
  if (!caller.origin.empty()) {
    const std::size_t scheme = caller.origin.find("://");
    const bool is_own =
        scheme != std::string_view::npos && caller.origin.substr(scheme + 3) == caller.host;
    if (!is_own && std::ranges::find(access.origins, caller.origin) == access.origins.end()) {
      return fmt::format(
          "pages of \"{}\" may not ask this server: \"origins\" of the application's "
          "\"live\" names those that may",
          caller.origin.substr(0, 128));
    }
  }
  constexpr std::string_view kBearer = "Bearer ";
  const std::string_view token = caller.authorization.starts_with(kBearer)
                                     ? caller.authorization.substr(kBearer.size())
                                     : query_value(caller.target, "token");
  if (token.empty()) {
    return "a token is missing: the application printed the address with it when it started";
  }
  if (!is_same_secret(token, access.token)) {
    return "the token is wrong: each run has another one, and printed it when it started";
  }
  return {};
}

std::string make_token() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("the system gives no random numbers");
  }
  std::string text;
  for (const unsigned char byte : bytes) {
    text += fmt::format("{:02x}", byte);
  }
  return text;
}

bool is_token(std::string_view text) {
  const auto is_allowed = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' ||
           c == '_';
  };
  return text.size() >= 32 && text.size() <= 256 && std::ranges::all_of(text, is_allowed);
}

bool is_same_secret(std::string_view a, std::string_view b) noexcept {
  std::size_t differences = a.size() ^ b.size();
  for (std::size_t i = 0; i < a.size(); ++i) {
    const char other = b.empty() ? '\0' : b[i % b.size()];
    differences |= static_cast<unsigned char>(a[i] ^ other);
  }
  return differences == 0 && !b.empty();
}

std::string_view query_value(std::string_view target, std::string_view name) {
  std::size_t begin = target.find('?');
  while (begin != std::string_view::npos) {
    const std::string_view rest = target.substr(begin + 1);
    const std::string_view one = rest.substr(0, rest.find('&'));
    const std::size_t equals = one.find('=');
    if (one.substr(0, equals) == name && equals != std::string_view::npos) {
      return one.substr(equals + 1);
    }
    begin = target.find('&', begin + 1);
  }
  return {};
}

}  // namespace fastcycle::web
