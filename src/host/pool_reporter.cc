#include "host/pool_reporter.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace fastcycle::host {

namespace {

template <typename... Args>
void warn(detail::LogSource& log, std::string_view component, fmt::format_string<Args...> text,
          Args&&... args) {
  std::array<char, detail::LogQueue::kTextBytes> line{};
  const auto written =
      fmt::format_to_n(line.data(), line.size(), text, std::forward<Args>(args)...);
  log.write(LogLevel::kWarning, component, {line.data(), std::min(written.size, line.size())});
}

}  // namespace

void PoolReporter::ran_short(const detail::PoolShortage& shortage) noexcept {
  switch (shortage.kind) {
    case detail::PoolShortage::Kind::kKept:
      warn(log_, shortage.component,
           "keeps {} messages of \"{}\" (publisher {}) beyond its callbacks, and {} are its share: "
           "it gets no further one until it lets go (dropped: pool). Give SubscriberOptions::keep "
           "the number that it needs, or copy the message instead of the Sample",
           shortage.held, shortage.topic.name, shortage.publisher, shortage.share);
      break;
    case detail::PoolShortage::Kind::kLoans:
      warn(log_, shortage.component,
           "holds {} loans of \"{}\" that it has neither published nor let go of, and its pool may "
           "have {} messages: what it publishes is dropped (pool). Publish each loan, or let it go "
           "out of scope",
           shortage.held, shortage.topic.name, shortage.limit);
      break;
    case detail::PoolShortage::Kind::kSmall:
      warn(log_, shortage.publisher,
           "has no message left for \"{}\", and its pool may have {}: what it publishes is dropped "
           "(pool). Component {} holds the most of them, {}. Raise \"pool_max\" of the topic, or "
           "lower the depth of its subscribers",
           shortage.topic.name, shortage.limit, shortage.component, shortage.held);
      break;
  }
}

}  // namespace fastcycle::host
