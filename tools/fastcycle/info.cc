#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "archive/message_text.h"
#include "archive/overview.h"
#include "base/printable.h"
#include "command.h"
#include "file_work.h"
#include "mcap/file.h"
#include "print.h"
#include "quantity.h"

namespace fastcycle::tool {
namespace {

using archive::Overview;
using archive::printable;
using archive::TopicOverview;
using Json = nlohmann::ordered_json;

struct InfoOptions {
  std::vector<std::filesystem::path> files;
  bool reads_all = false;
  bool is_json = false;
  bool is_quiet = false;
};

std::uint64_t duration_ns(const mcap::Statistics& statistics) {
  return statistics.message_end_time_ns -
         std::min(statistics.message_start_time_ns, statistics.message_end_time_ns);
}

std::optional<double> rate_hz(const TopicOverview& topic, const mcap::Statistics& statistics) {
  const std::uint64_t ns = duration_ns(statistics);
  return ns == 0
             ? std::nullopt
             : std::optional(static_cast<double>(topic.messages) * 1e9 / static_cast<double>(ns));
}

std::string joined(const std::set<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

std::string health(const Overview& file) {
  if (file.problem) {
    return to_string(*file.problem);
  }
  return std::string("closed") + (file.was_scanned ? ", without a complete summary" : "") +
         (file.was_read ? ", all of it can be read" : "");
}

// ---- As text ----

void print_line(const char* name, const std::string& value) {
  print_to(stdout, "  {:<11} {}\n", name, value);
}

/// Rows with their columns below each other.
void print_table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) {
      widths[i] = std::max(widths[i], row[i].size());
    }
  }
  for (const auto& row : rows) {
    std::string line = "   ";
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += ' ' + row[i] + std::string(widths[i] - row[i].size() + 1, ' ');
    }
    line.erase(line.find_last_not_of(' ') + 1);
    print_to(stdout, "{}\n", line);
  }
}

std::string loss_text(const archive::TopicLoss& loss) {
  if (loss.lost == 0) {
    return fmt::format("lost none of {}", loss.published);
  }
  std::string text = fmt::format("lost {} of {}", loss.lost, loss.published);
  for (const auto& [reason, count] : loss.reasons) {
    text += fmt::format(", {} {}", printable(reason), count);
  }
  return text;
}

void print_topics(const Overview& file) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& [name, topic] : file.topics) {
    const std::optional<double> rate = rate_hz(topic, file.statistics);
    rows.push_back(
        {printable(name), printable(joined(topic.types)), printable(joined(topic.encodings)),
         fmt::format("{}", topic.messages), rate ? fmt::format("{:.1f} Hz", *rate) : "-",
         topic.bytes ? bytes_text(*topic.bytes) : "", topic.loss ? loss_text(*topic.loss) : ""});
  }
  print_to(stdout, "  topics\n");
  print_table(rows);
}

/// Key and value, each on its own line; of many keys `build_id.X` only their number.
std::vector<std::vector<std::string>> rows_of(const mcap::Metadata& metadata) {
  constexpr std::size_t kFew = 3;
  std::map<std::string, std::size_t> groups;
  const auto group_of = [](const std::string& key) { return key.substr(0, key.find('.')); };
  for (const auto& [key, value] : metadata.metadata) {
    groups[group_of(key)] += key.find('.') != std::string::npos ? 1 : 0;
  }
  std::vector<std::vector<std::string>> rows;
  for (const auto& [key, value] : metadata.metadata) {
    std::size_t& count = groups[group_of(key)];
    if (key.find('.') == std::string::npos || (count > 0 && count <= kFew)) {
      rows.push_back({"  " + printable(key), printable(value)});
    } else if (const std::size_t all = std::exchange(count, 0); all > 0) {
      rows.push_back({"  " + printable(group_of(key)) + ".*", fmt::format("{} of them", all)});
    }
  }
  return rows;
}

void print_metadata(const Overview& file) {
  std::vector<std::vector<std::string>> rows;
  for (const mcap::Metadata& one : file.metadata) {
    if (one.name == "fastcycle.loss") {
      continue;  // It is listed with the topics.
    }
    rows.push_back({printable(one.name)});
    for (auto& row : rows_of(one)) {
      rows.push_back(std::move(row));
    }
  }
  if (!rows.empty()) {
    print_to(stdout, "  metadata\n");
    print_table(rows);
  }
}

void print_explanation(const Overview& file) {
  std::vector<std::vector<std::string>> attachments;
  for (const mcap::AttachmentIndex& index : file.attachments) {
    attachments.push_back(
        {printable(index.name), printable(index.media_type), bytes_text(index.data_size)});
  }
  if (!attachments.empty()) {
    print_to(stdout, "  attachments\n");
    print_table(attachments);
  }
  print_metadata(file);
}

void print_times(const mcap::Statistics& statistics) {
  if (statistics.message_count > 0) {
    print_line("begin", utc_text(statistics.message_start_time_ns));
    print_line("end", utc_text(statistics.message_end_time_ns));
    print_line("duration", seconds_text(duration_ns(statistics)));
  }
  print_line("messages", fmt::format("{}", statistics.message_count));
}

void print(const Overview& file) {
  print_to(stdout, "{}\n", file.file);
  const std::string& profile = file.header.profile;
  print_line("size", bytes_text(file.bytes));
  print_line("written by", (file.header.library.empty() ? "?" : printable(file.header.library)) +
                               (profile.empty() ? "" : ", profile " + printable(profile)));
  print_line("health", health(file));
  print_times(file.statistics);
  for (const auto& [compression, chunks] : file.chunks) {
    print_line(
        "chunks",
        fmt::format("{} {}, {} of {}", chunks.count,
                    compression.empty() ? "not compressed" : printable(compression),
                    bytes_text(chunks.compressed_bytes), bytes_text(chunks.uncompressed_bytes)));
  }
  if (!file.topics.empty()) {
    print_topics(file);
  }
  print_explanation(file);
}

// ---- Of several files ----

struct Gap {
  std::string from;
  std::string to;
  std::int64_t ns = 0;  ///< Below 0: they overlap.
};

std::vector<Gap> gaps_between(const std::vector<Overview>& files) {
  std::vector<Gap> gaps;
  const Overview* before = nullptr;
  for (const Overview& file : files) {
    if (file.statistics.message_count == 0) {
      continue;
    }
    if (before != nullptr) {
      gaps.push_back({.from = before->file,
                      .to = file.file,
                      .ns = static_cast<std::int64_t>(file.statistics.message_start_time_ns -
                                                      before->statistics.message_end_time_ns)});
    }
    before = &file;
  }
  return gaps;
}

mcap::Statistics together(const std::vector<Overview>& files) {
  mcap::Statistics all;
  all.message_start_time_ns = std::numeric_limits<std::uint64_t>::max();
  for (const Overview& file : files) {
    if (file.statistics.message_count > 0) {
      all.message_count += file.statistics.message_count;
      all.message_start_time_ns =
          std::min(all.message_start_time_ns, file.statistics.message_start_time_ns);
      all.message_end_time_ns =
          std::max(all.message_end_time_ns, file.statistics.message_end_time_ns);
    }
  }
  return all;
}

void print_together(const std::vector<Overview>& files) {
  print_to(stdout, "together\n");
  print_times(together(files));
  for (const Gap& gap : gaps_between(files)) {
    print_line(gap.ns < 0 ? "overlap" : "gap",
               fmt::format("{}, {} to {}",
                           seconds_text(static_cast<std::uint64_t>(gap.ns < 0 ? -gap.ns : gap.ns)),
                           gap.from, gap.to));
  }
}

// ---- As JSON ----

Json to_json(const TopicOverview& topic, const mcap::Statistics& statistics) {
  Json json{{"types", topic.types},
            {"encodings", topic.encodings},
            {"channels", topic.channels},
            {"messages", topic.messages}};
  if (const std::optional<double> rate = rate_hz(topic, statistics)) {
    json["rate_hz"] = *rate;
  }
  if (topic.bytes) {
    json["bytes"] = *topic.bytes;
  }
  if (topic.loss) {
    json["loss"] = {{"published", topic.loss->published},
                    {"recorded", topic.loss->recorded},
                    {"lost", topic.loss->lost},
                    {"reasons", topic.loss->reasons}};
  }
  return json;
}

Json times_of(const mcap::Statistics& statistics) {
  Json json{{"messages", statistics.message_count}};
  if (statistics.message_count > 0) {
    json["begin_ns"] = statistics.message_start_time_ns;
    json["end_ns"] = statistics.message_end_time_ns;
    json["duration_ns"] = duration_ns(statistics);
  }
  return json;
}

Json to_json(const Overview& file) {
  Json json{{"file", file.file},
            {"bytes", file.bytes},
            {"library", file.header.library},
            {"profile", file.header.profile},
            {"has_summary", !file.was_scanned},
            {"was_read", file.was_read}};
  json["problem"] = file.problem ? Json(to_string(*file.problem)) : Json(nullptr);
  json.update(times_of(file.statistics));
  json["chunks"] = Json::array();
  for (const auto& [compression, chunks] : file.chunks) {
    json["chunks"].push_back({{"compression", compression},
                              {"count", chunks.count},
                              {"compressed_bytes", chunks.compressed_bytes},
                              {"uncompressed_bytes", chunks.uncompressed_bytes}});
  }
  json["topics"] = Json::object();
  for (const auto& [name, topic] : file.topics) {
    json["topics"][name] = to_json(topic, file.statistics);
  }
  json["attachments"] = Json::array();
  for (const mcap::AttachmentIndex& index : file.attachments) {
    json["attachments"].push_back({{"name", index.name},
                                   {"media_type", index.media_type},
                                   {"log_time_ns", index.log_time_ns},
                                   {"bytes", index.data_size}});
  }
  json["metadata"] = Json::array();
  for (const mcap::Metadata& one : file.metadata) {
    json["metadata"].push_back({{"name", one.name}, {"metadata", one.metadata}});
  }
  return json;
}

void print_json(const std::vector<Overview>& files) {
  Json json{{"files", Json::array()}};
  for (const Overview& file : files) {
    json["files"].push_back(to_json(file));
  }
  if (files.size() > 1) {
    json["together"] = times_of(together(files));
    for (const Gap& gap : gaps_between(files)) {
      json["together"]["gaps"].push_back({{"from", gap.from}, {"to", gap.to}, {"ns", gap.ns}});
    }
  }
  print_to(stdout, "{}\n",
           base::printable_json(json.dump(2, ' ', false, Json::error_handler_t::replace)));
}

int info(const InfoOptions& options) {
  std::vector<Overview> files;
  for (const std::filesystem::path& name : options.files) {
    for (const std::filesystem::path& path : archive::files_of_recording(name)) {
      const mcap::FileSource source(path);
      FileWork work(!options.is_quiet);
      archive::OverviewOptions how;
      if (options.reads_all) {
        how.read_whole_bytes = std::numeric_limits<std::uint64_t>::max();
      }
      files.push_back(
          archive::overview(source, how, work.progress(path.filename().string(), source.size())));
    }
  }
  if (options.is_json) {
    print_json(files);
    return flush_output();
  }
  for (const Overview& file : files) {
    print(file);
  }
  if (files.size() > 1) {
    print_together(files);
  }
  return flush_output();
}

}  // namespace

Command add_info(CLI::App& program) {
  CLI::App* line = program.add_subcommand("info", "Show the contents and condition of a log");
  line->footer(examples(
      "  fastcycle info drive.mcap\n"
      "  fastcycle info drive_0001.mcap drive_0002.mcap.active\n"
      "  fastcycle info --json drive.mcap\n"
      "\n"
      "The name of a split recording stands for all of its files. Files up to 256 MiB are\n"
      "read completely; for larger ones, --all determines the sizes of topics.\n"));
  const auto options = std::make_shared<InfoOptions>();
  line->add_option("files", options->files, "The logs")->required()->type_name("FILE…");
  line->add_flag("--all", options->reads_all,
                 "Read large files completely too, for sizes and damage");
  line->add_flag("--json", options->is_json, "Print JSON");
  line->add_flag("--quiet", options->is_quiet, "Print no progress line");
  return {line, [options] { return info(*options); }};
}

}  // namespace fastcycle::tool
