#include "broker/activation_check.h"

#include <fmt/format.h>

#include "fastcycle/assert.h"

namespace fastcycle::detail {

void broke_contract(const PublishingComponent& component, std::string_view what,
                    std::string_view remedy) noexcept {
  contract_broken(fmt::format("component \"{}\": {}; {}", component.name, what, remedy).c_str());
}

void called_outside(const PublishingComponent& component, std::string_view call,
                    std::string_view name, std::string_view remedy) noexcept {
  broke_contract(component, fmt::format("{} \"{}\" outside of a callback", call, name), remedy);
}

}  // namespace fastcycle::detail
