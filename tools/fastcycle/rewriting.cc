#include "rewriting.h"

#include <cstdio>
#include <memory>

#include <fmt/format.h>

#include "archive/output_file.h"
#include "command.h"
#include "file_work.h"
#include "mcap/compression.h"
#include "print.h"
#include "quantity.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;

/// The files that are written, one after the other; each gets its name when the next one begins.
class Pieces {
 public:
  explicit Pieces(archive::OutputFile::Options options) : options_(options) {}

  mcap::Sink& begin(const fs::path& path) {
    commit();
    file_ = std::make_unique<archive::OutputFile>(path, options_);
    return file_->sink();
  }
  void commit() {
    if (file_ != nullptr) {
      file_->commit();
      names_ = names_.empty() ? file_->path().string() : first_ + " to " + file_->path().string();
      first_ = first_.empty() ? names_ : first_;
      file_.reset();
    }
  }
  /// `drive_0001.mcap to drive_0003.mcap`
  [[nodiscard]] const std::string& names() const { return names_; }

 private:
  const archive::OutputFile::Options options_;
  std::unique_ptr<archive::OutputFile> file_;
  std::string first_;
  std::string names_;
};

}  // namespace

std::string read_compression(const std::string& name, mcap::ChunkOptions& chunk) {
  const auto compression = mcap::find_compression(name == "none" ? "" : name);
  if (name.empty() || !compression) {
    return "--compression is \"none\", \"lz4\" or \"zstd\", not \"" + name + "\"";
  }
  chunk.compression = *compression;
  return {};
}

std::string read_offset(const std::string& option, const std::string& text,
                        std::optional<std::uint64_t>& offset_ns) {
  if (text.empty()) {
    return {};
  }
  offset_ns = parse_offset(text);
  return offset_ns ? std::string()
                   : option +
                         " expects a time from the beginning of the file, as 10s or 500ms, and "
                         "not \"" +
                         text + "\"";
}

void Rewriting::add_options(CLI::App& line) {
  line.add_option("--compression", compression, "Compression of chunks (lz4)")
      ->type_name("none|lz4|zstd");
  line.add_option("--chunk-size", chunk_size, "Size of a chunk before compression (1MiB)")
      ->type_name("SIZE");
  line.add_flag("--force", is_forced, "Overwrite an existing output");
  line.add_flag("--quiet", is_quiet, "Print no progress line and no summary");
}

std::string Rewriting::find_wrong() {
  if (std::string wrong = read_compression(compression, layout.chunk); !wrong.empty()) {
    return wrong;
  }
  constexpr std::uint64_t kMostChunkBytes = std::uint64_t{256} << 20U;
  const std::optional<std::uint64_t> bytes = parse_bytes(chunk_size);
  if (!bytes || *bytes > kMostChunkBytes) {
    return "--chunk-size expects a size up to 256MiB with its unit, as 64KiB or 4MB, and not \"" +
           chunk_size + "\"";
  }
  layout.chunk_bytes = *bytes;
  return {};
}

fs::path Rewriting::path_of(std::uint64_t number) const {
  const bool is_split = layout.piece.bytes > 0 || layout.piece.time_ns > 0;
  return is_split ? fs::path(fmt::format("{}_{:04}.mcap", output.string(), number)) : output;
}

int Rewriting::run() {
  if (const std::string wrong = find_wrong(); !wrong.empty()) {
    return print_error(command, wrong);
  }
  std::vector<std::unique_ptr<mcap::FileSource>> sources;
  std::vector<const mcap::Source*> readable;
  std::uint64_t bytes = 0;
  for (const fs::path& input : inputs) {
    sources.push_back(std::make_unique<mcap::FileSource>(input));
    readable.push_back(sources.back().get());
    bytes += sources.back()->size();
  }
  archive::Rewritten result;
  Pieces pieces({.may_replace = is_forced, .inputs = inputs});
  {
    FileWork work(!is_quiet);
    result = archive::rewrite(
        readable,
        [&](std::uint64_t number) -> mcap::Sink& { return pieces.begin(path_of(number)); }, layout,
        selection, work.progress(command, bytes));
    pieces.commit();
  }
  for (const mcap::Problem& problem : result.problems) {
    print_problem(command, problem, "the readable part was used");
  }
  if (!is_quiet) {
    print_to(stdout, "{}: {} messages\n", pieces.names(), result.messages);
  }
  return flush_output();
}

}  // namespace fastcycle::tool
