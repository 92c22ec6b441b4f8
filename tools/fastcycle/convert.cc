#include <cstdio>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "archive/message_text.h"
#include "archive/output_file.h"
#include "archive/readable.h"
#include "command.h"
#include "file_work.h"
#include "print.h"
#include "rewriting.h"
#include "rosbag/rosbag.h"

namespace fastcycle::tool {
namespace {

/// Says what was not converted; the exit code.
int print_result(const Rewriting& work, const rosbag::Converted& done) {
  const std::string in = work.inputs[0].string();
  for (const mcap::Problem& problem : done.problems) {
    print_problem(work.command, problem, "the readable part was used");
  }
  std::uint64_t copied = 0;
  bool is_all = true;
  std::string words;
  for (const rosbag::Topic& topic : done.topics) {
    if (!topic.is_converted) {
      copied += topic.messages;
      words += fmt::format("{}: {}: unknown type {}; copied without conversion: {} messages\n", in,
                           archive::printable(topic.name),
                           topic.type.empty() ? "no type" : archive::printable(topic.type),
                           topic.messages);
    } else if (topic.unreadable > 0) {
      is_all = false;
      words += fmt::format("{}: {}: not valid {}, left out: {} of {} messages; the first: {}\n", in,
                           archive::printable(topic.name), topic.type, topic.unreadable,
                           topic.messages, archive::printable(topic.error));
    }
  }
  print_text(stderr, words);
  if (!work.is_quiet) {
    print_to(stdout, "{}: {} messages of a ROS bag, of which {} are copied without conversion\n",
             work.output.string(), done.messages, copied);
  }
  const int code = flush_output();
  return code == kDone && !is_all ? kProblems : code;
}

int convert_rosbag(Rewriting& work, const mcap::FileSource& source) {
  archive::OutputFile file(work.output.string(),
                           {.may_replace = work.is_forced, .inputs = work.inputs});
  rosbag::Converted done;
  {
    FileWork file_work(!work.is_quiet);
    done = rosbag::convert(source, file.sink(), work.layout,
                           file_work.progress(work.command, source.size()));
    archive::require_messages(
        done.problems.empty() ? std::nullopt : std::optional(done.problems.front()), done.messages);
    file.commit();
  }
  return print_result(work, done);
}

}  // namespace

Command add_convert(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "convert",
      "Rewrite a log with another compression, chunk size or index, or convert a ROS 2 bag");
  line->footer(
      examples("  fastcycle convert drive.mcap small.mcap --compression zstd\n"
               "  fastcycle convert drive.mcap plain.mcap --compression none --no-index\n"
               "  fastcycle convert rosbag2_0.mcap drive.mcap\n"));
  const auto work = std::make_shared<Rewriting>();
  const auto has_no_index = std::make_shared<bool>(false);
  const auto is_as_it_is = std::make_shared<bool>(false);
  work->command = "convert";
  work->inputs.resize(1);
  line->add_option("in", work->inputs[0], "The log")->required()->type_name("IN");
  line->add_option("out", work->output, "The new log")->required()->type_name("OUT");
  line->add_flag("--no-index", *has_no_index,
                 "Write no chunk and message indexes; readers then have to scan the whole file");
  line->add_flag("--as-it-is", *is_as_it_is, "Keep ROS messages in their original encoding");
  work->add_options(*line);
  return {line, [work, has_no_index, is_as_it_is] {
            work->layout.has_index = !*has_no_index;
            if (const std::string wrong = work->find_wrong(); !wrong.empty()) {
              return print_error(work->command, wrong);
            }
            if (!*is_as_it_is) {
              const mcap::FileSource source(work->inputs[0]);
              if (rosbag::is_rosbag(source)) {
                return convert_rosbag(*work, source);
              }
            }
            return work->run();
          }};
}

}  // namespace fastcycle::tool
