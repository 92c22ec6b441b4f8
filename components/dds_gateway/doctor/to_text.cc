#include "dds_gateway/doctor/to_text.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWhoMax = 200;     // Listed in the text.
constexpr std::size_t kTopicsMax = 100;  // Of each.

std::string_view word_of(Level level) {
  constexpr std::array<std::string_view, 3> kWords = {"ok", "better", "problem"};
  return kWords[static_cast<std::size_t>(level)];
}

std::string line_of(const Finding& finding) {
  std::string text = fmt::format("  {:<8} {:<16} {}\n", word_of(finding.level), finding.name,
                                 base::printable(finding.found));
  if (finding.level != Level::kFine) {
    text += fmt::format("  {:<8} {:<16}   {}\n", "", "", base::printable(finding.why));
    text += fmt::format("  {:<8} {:<16}   $ {}\n", "", "", base::printable(finding.remedy));
  }
  return text;
}

/// The location of a participant, from its announcements.
std::string place_of(const Observation& seen, const Guid& participant) {
  const auto found =
      std::ranges::find_if(seen.announcements, [&](const ReceivedAnnouncement& received) {
        return received.announcement.participant == participant;
      });
  return found == seen.announcements.end() ? "" : fmt::format(", {}", found->from);
}

std::string who_is_there(const Observation& seen) {
  std::map<std::string, std::vector<const FoundEndpoint*>> all;
  for (const FoundEndpoint& endpoint : seen.endpoints) {
    all[name_of(endpoint)].push_back(&endpoint);
  }
  for (const FoundParticipant& participant : seen.participants) {
    if (std::ranges::find(seen.endpoints, participant.guid, &FoundEndpoint::participant) ==
        seen.endpoints.end()) {
      all[fmt::format("the participant {}", text_of(participant.guid))];
    }
  }
  if (all.empty()) {
    return {};
  }
  std::string text = "\nWho is there:\n";
  std::size_t listed = 0;
  for (const auto& [who, endpoints] : all) {
    if (++listed > kWhoMax) {
      text += fmt::format("\n  … and {} more\n", all.size() - kWhoMax);
      break;
    }
    text += fmt::format("\n  {}", base::printable(who));
    if (!endpoints.empty()) {
      const Guid& participant = endpoints.front()->participant;
      text += fmt::format(" ({}{})", implementation_of(participant), place_of(seen, participant));
    }
    text += "\n";
    std::size_t topics = 0;
    for (const FoundEndpoint* const one : endpoints) {
      if (++topics > kTopicsMax) {
        text += fmt::format("    … and {} more\n", endpoints.size() - kTopicsMax);
        break;
      }
      text += fmt::format("    {:<7} {}  {}  {}\n", one->endpoint.is_reader ? "reads" : "writes",
                          base::printable(topic_of(one->endpoint)),
                          base::printable(type_of(one->endpoint)), to_text(one->endpoint.qos));
    }
  }
  return text;
}

Json microseconds(const std::vector<std::chrono::nanoseconds>& sorted) {
  if (sorted.empty()) {
    return nullptr;
  }
  const auto us = [](std::chrono::nanoseconds time) {
    return static_cast<double>(time.count()) / 1e3;
  };
  return {{"min", us(sorted.front())},
          {"p50", us(sorted[sorted.size() / 2])},
          {"max", us(sorted.back())},
          {"count", sorted.size()}};
}

}  // namespace

std::string to_text(const Observation& seen, const std::vector<Finding>& findings) {
  std::string text = "\n";
  for (const Finding& finding : findings) {
    text += line_of(finding);
  }
  text += who_is_there(seen);
  const auto count = [&](Level level) {
    return std::ranges::count(findings, level, &Finding::level);
  };
  const auto problems = count(Level::kProblem);
  const auto advice = count(Level::kAdvice);
  return text + fmt::format("\n{} problem{}, {} possible improvement{}\n", problems,
                            problems == 1 ? "" : "s", advice, advice == 1 ? "" : "s");
}

std::string to_json(const Observation& seen, const std::vector<Finding>& findings) {
  Json json{{"domain", seen.domain},
            {"interface", seen.interface},
            {"watched_s", seen.watched.count()},
            {"findings", Json::array()},
            {"participants", Json::array()},
            {"endpoints", Json::array()},
            {"received", Json::array()}};
  for (const Finding& finding : findings) {
    Json one{{"name", finding.name}, {"level", word_of(finding.level)}, {"found", finding.found}};
    if (finding.level != Level::kFine) {
      one["why"] = finding.why;
      one["remedy"] = finding.remedy;
    }
    json["findings"].push_back(std::move(one));
  }
  for (const FoundParticipant& participant : seen.participants) {
    json["participants"].push_back({{"guid", text_of(participant.guid)},
                                    {"implementation", implementation_of(participant.guid)},
                                    {"user_data", participant.user_data}});
  }
  for (const FoundEndpoint& one : seen.endpoints) {
    json["endpoints"].push_back(
        {{"topic", topic_of(one.endpoint)},
         {"type", type_of(one.endpoint)},
         {"is_reader", one.endpoint.is_reader},
         {"reliability", one.endpoint.qos.is_reliable ? "reliable" : "best_effort"},
         {"durability", one.endpoint.qos.is_transient_local ? "transient_local" : "volatile"},
         {"type_hash", ros2::value_of(one.endpoint.user_data, "typehash")},
         {"node", one.node},
         {"participant", text_of(one.participant)}});
  }
  for (const ReceivedAnnouncement& received : seen.announcements) {
    json["received"].push_back({{"participant", text_of(received.announcement.participant)},
                                {"domain", received.domain},
                                {"from", received.from},
                                {"interface", received.interface},
                                {"is_secured", received.announcement.is_secured}});
  }
  if (seen.round_trip) {
    json["round_trip_us"] = {{"64 B", microseconds(seen.round_trip->small)},
                             {"1 MiB", microseconds(seen.round_trip->large)},
                             {"lost", seen.round_trip->lost}};
  }
  return base::printable_json(json.dump(2, ' ', false, Json::error_handler_t::replace)) + "\n";
}

}  // namespace fastcycle::dds_gateway
