#include "archive/export.h"

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <unistd.h>

#include "archive/output_file.h"
#include "archive/readable.h"
#include "command.h"
#include "file_work.h"
#include "mcap/reader.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  fs::path file;
  std::vector<std::string> topics;
  fs::path output;
  std::size_t max_repeated = 64;
  bool is_forced = false;
  bool is_quiet = false;
};

/// Nobody reads standard output any more.
struct OutputClosed {};

/// Collects rows, to write them in larger blocks.
class Rows {
 public:
  explicit Rows(mcap::Sink& sink) : sink_(sink) {}

  void add(std::string_view row) {
    text_ += row;
    if (text_.size() >= kBytes) {
      flush();
    }
  }
  void flush() {
    const mcap::Bytes bytes = mcap::bytes_of(text_);
    sink_.append({&bytes, 1});
    text_.clear();
  }

 private:
  static constexpr std::size_t kBytes = std::size_t{256} << 10U;
  mcap::Sink& sink_;
  std::string text_;
};

/// `control/speed` becomes `control.speed.csv`.
std::string file_name_of(std::string topic) {
  for (char& letter : topic) {
    const bool is_plain = static_cast<unsigned char>(letter) >= ' ';
    letter = letter == '/' ? '.' : is_plain ? letter : '_';
  }
  return topic + ".csv";
}

/// Converts progress in messages, each counted twice, to `progress` in the file's `bytes`.
archive::Progress progress_by_messages(const mcap::Reader& reader, const std::string& topic,
                                       std::uint64_t bytes, archive::Progress progress) {
  std::uint64_t messages = 0;
  const auto& counts = reader.statistics()->channel_message_counts;
  for (const auto& [id, channel] : reader.definitions().channels()) {
    const auto count = counts.find(id);
    messages += channel.topic == topic && count != counts.end() ? count->second : 0;
  }
  const double bytes_a_look =
      messages == 0 ? 0.0 : static_cast<double>(bytes) / (2.0 * static_cast<double>(messages));
  return [bytes_a_look, progress = std::move(progress)](std::uint64_t looks) {
    progress(static_cast<std::uint64_t>(bytes_a_look * static_cast<double>(looks)));
  };
}

archive::Table export_to_file(const mcap::Reader& reader, const ExportOptions& options,
                              const std::string& topic, const fs::path& path,
                              const archive::Progress& progress) {
  const std::vector<fs::path> inputs{options.file};
  archive::OutputFile file(path, {.may_replace = options.is_forced, .inputs = inputs});
  Rows rows(file.sink());
  archive::Table table = archive::export_table(
      reader, options.file.string(), {.topic = topic, .most_elements = options.max_repeated},
      [&](std::string_view row) { rows.add(row); }, progress);
  rows.flush();
  file.commit();
  return table;
}

archive::Table export_to_output(const mcap::Reader& reader, const ExportOptions& options,
                                const std::string& topic) {
  Output output;
  const bool is_for_people = isatty(STDOUT_FILENO) != 0;
  archive::Table table = archive::export_table(
      reader, options.file.string(), {.topic = topic, .most_elements = options.max_repeated},
      [&](std::string_view row) {
        if (!(is_for_people ? output.write(row) : output.write_data(row))) {
          throw OutputClosed();
        }
      });
  output.flush();
  return table;
}

void print_cut(const archive::Table& table, const std::string& topic) {
  for (const std::string& field : table.cut) {
    print_to(stderr,
             "fastcycle export: {}: some elements of {} have no column (--max-repeated N)\n", topic,
             field);
  }
}

int run(const ExportOptions& options) {
  const mcap::FileSource source(options.file);
  const mcap::Reader reader(source);
  archive::require_messages(reader.problem(), reader.statistics()->message_count);
  if (reader.problem()) {
    print_problem("export", *reader.problem(), "the readable part was used");
  }
  if (options.output.empty()) {
    try {
      print_cut(export_to_output(reader, options, options.topics.front()), options.topics.front());
    } catch (const OutputClosed&) {
      return kDone;
    }
    return kDone;
  }
  const bool is_folder = options.topics.size() > 1 || fs::is_directory(options.output);
  if (is_folder) {
    fs::create_directories(options.output);
  }
  FileWork work(!options.is_quiet);
  for (const std::string& topic : options.topics) {
    const fs::path path = is_folder ? options.output / file_name_of(topic) : options.output;
    const archive::Table table = export_to_file(
        reader, options, topic, path,
        progress_by_messages(reader, topic, source.size(), work.progress(topic, source.size())));
    print_cut(table, topic);
    if (!options.is_quiet) {
      print_to(stdout, "{}: {} rows, {} columns\n", path.string(), table.rows, table.columns);
    }
  }
  return flush_output();
}

int export_topics(const ExportOptions& options) {
  if (options.output.empty() && options.topics.size() > 1) {
    return print_error("export", "several topics require a folder for their files: -o DIR");
  }
  return run(options);
}

}  // namespace

Command add_export(CLI::App& program) {
  CLI::App* line = program.add_subcommand("export", "Write the messages of topics to CSV tables");
  line->footer(
      examples("  fastcycle export drive.mcap --topic control/speed -o speed.csv\n"
               "  fastcycle export drive.mcap --topic control/speed --topic imu/accel -o tables\n"
               "  fastcycle export drive.mcap --topic control/speed | head\n"));
  const auto options = std::make_shared<ExportOptions>();
  line->add_option("file", options->file, "The log")->required()->type_name("FILE");
  line->add_option("--topic", options->topics, "A topic with protobuf messages. Repeatable")
      ->required()
      ->allow_extra_args(false)
      ->type_name("T");
  line->add_option("-o,--output", options->output,
                   "Output: FILE.csv, or a folder for several topics (standard output)")
      ->type_name("PATH");
  line->add_option("--max-repeated", options->max_repeated,
                   "Maximum number of columns for a repeated field (64)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  line->add_flag("--force", options->is_forced, "Overwrite an existing output");
  line->add_flag("--quiet", options->is_quiet, "Print no progress line and no summary");
  return {line, [options] { return export_topics(*options); }};
}

}  // namespace fastcycle::tool
