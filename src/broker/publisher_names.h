#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "base/priority_mutex.h"
#include "fastcycle/message.h"

namespace fastcycle::detail {

/// The names of publishers by their ids: those of this application, and those of others that sent
/// messages.
///
/// @threads  Safe.
class PublisherNames {
 public:
  static constexpr std::size_t kMax = 65'536;  ///< Further ones have no name.

  struct Names {
    std::string component;
    std::string topic;
  };

  /// The first names of an id are kept.
  void learn(PublisherId publisher, std::string_view component, std::string_view topic) {
    const std::lock_guard lock(mutex_);
    if (names_.size() < kMax) {
      names_.try_emplace(publisher, Names{std::string(component), std::string(topic)});
    }
  }
  [[nodiscard]] std::optional<Names> find(PublisherId publisher) const {
    const std::lock_guard lock(mutex_);
    const auto found = names_.find(publisher);
    return found == names_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  mutable base::PriorityMutex mutex_;
  std::map<PublisherId, Names> names_;  // Guarded by it.
};

}  // namespace fastcycle::detail
