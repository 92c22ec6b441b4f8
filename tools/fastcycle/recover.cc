#include "archive/recover.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "archive/output_file.h"
#include "command.h"
#include "file_work.h"
#include "mcap/file.h"
#include "mcap/record_reader.h"
#include "mcap/records.h"
#include "print.h"
#include "quantity.h"
#include "rewriting.h"

namespace fastcycle::tool {
namespace {

struct RecoverOptions {
  std::filesystem::path input;
  std::filesystem::path output;
  std::string compression = "lz4";
  bool is_forced = false;
  bool is_quiet = false;
};

/// Whatever follows the end of the log, such as a second log, is not in the new one: it is no end
/// that was mended, but lost.
void count_what_follows(const mcap::Source& input, archive::Recovery& recovery) {
  const auto found = std::ranges::find_if(recovery.mended, mcap::is_behind_end);
  if (found == recovery.mended.end()) {
    return;
  }
  const std::uint64_t begin = found->place.offset + mcap::kMagic.size();
  archive::Loss loss{.problem = *found, .bytes = input.size() - begin, .messages = {}};
  recovery.mended.erase(found);
  std::array<std::byte, mcap::kMagic.size()> magic{};
  if (loss.bytes >= magic.size()) {
    input.read(begin, magic);
  }
  if (magic == mcap::kMagic) {
    loss.problem.found += fmt::format(", another log from byte {} on", begin);
  }
  ++recovery.loss_count;
  recovery.lost_bytes += loss.bytes;
  recovery.losses.push_back(std::move(loss));
}

void print(const archive::Recovery& recovery) {
  for (const mcap::Problem& problem : recovery.mended) {
    print_to(stderr, "mended: {}\n", to_string(problem));
  }
  for (const archive::Loss& loss : recovery.losses) {
    std::string what = loss.bytes > 0 ? bytes_text(loss.bytes) : "";
    if (loss.messages) {
      what += (what.empty() ? "" : ", ") + std::to_string(*loss.messages) + " messages";
    }
    print_to(stderr, "lost{}{}: {}\n", what.empty() ? "" : " ", what, to_string(loss.problem));
  }
  if (recovery.loss_count > recovery.losses.size()) {
    print_to(stderr, "lost: {} more places\n", recovery.loss_count - recovery.losses.size());
  }
}

std::string lost_text(const archive::Recovery& recovery) {
  if (recovery.loss_count == 0) {
    return "nothing";
  }
  std::string text = bytes_text(recovery.lost_bytes) + " at " +
                     std::to_string(recovery.loss_count) +
                     (recovery.loss_count == 1 ? " place" : " places");
  return text + (recovery.lost_messages > 0
                     ? ", " + std::to_string(recovery.lost_messages) + " messages"
                     : ", an unknown number of messages");
}

int recover(const RecoverOptions& options) {
  archive::RecoverOptions how;
  if (const std::string wrong = read_compression(options.compression, how.chunk); !wrong.empty()) {
    return print_error("recover", wrong);
  }
  const mcap::FileSource input(options.input);
  const std::vector<std::filesystem::path> inputs{options.input};
  archive::OutputFile output(options.output, {.may_replace = options.is_forced, .inputs = inputs});
  archive::Recovery recovery;
  {
    FileWork work(!options.is_quiet);
    recovery =
        archive::recover(input, output.sink(), how, work.progress("recovering", input.size()));
    if (!recovery.is_hopeless()) {
      const mcap::FileSource written(output.unfinished());
      archive::verify(written, recovery.kept, work.progress("verifying", written.size()));
      output.commit();
    }
  }
  count_what_follows(input, recovery);
  print(recovery);
  if (recovery.is_hopeless()) {
    print_to(stderr, "fastcycle recover: nothing could be recovered from {}\n",
             options.input.string());
    return kFailed;
  }
  if (!options.is_quiet) {
    const archive::ContentSum& kept = recovery.kept;
    print_to(stdout, "{}: {} messages, {} attachments, {} metadata, verified; lost: ",
             options.output.string(), kept.messages, kept.attachments, kept.metadata);
    print_to(stdout, "{}\n", lost_text(recovery));
  }
  const int printed = flush_output();
  return printed == kDone && recovery.loss_count > 0 ? kProblems : printed;
}

}  // namespace

Command add_recover(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("recover", "Recover a log that was not closed or is damaged");
  line->footer(examples(
      "  fastcycle recover drive.mcap.active drive.mcap\n"
      "\n"
      "The new file is read completely and compared with the written data before it is\n"
      "renamed. Exit codes: 0 everything was recovered, 3 something was lost (it is listed),\n"
      "1 nothing could be recovered, 2 the command line is wrong.\n"));
  const auto options = std::make_shared<RecoverOptions>();
  line->add_option("in", options->input, "The log")->required()->type_name("IN");
  line->add_option("out", options->output, "The new log")->required()->type_name("OUT");
  line->add_option("--compression", options->compression, "Compression of chunks (lz4)")
      ->type_name("none|lz4|zstd");
  line->add_flag("--force", options->is_forced, "Overwrite an existing output");
  line->add_flag("--quiet", options->is_quiet, "Print no progress line and no summary");
  return {line, [options] { return recover(*options); }};
}

}  // namespace fastcycle::tool
