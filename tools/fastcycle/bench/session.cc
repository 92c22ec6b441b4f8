#include "bench/session.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/output_file.h"
#include "command.h"
#include "print.h"
#include "redrawn_line.h"

namespace fastcycle::tool::bench {
namespace {

bool is_terminal() {
  return isatty(STDERR_FILENO) != 0;
}

}  // namespace

std::string damaged_json(std::int64_t damaged) {
  return fmt::format("\"damaged\":{}", damaged);
}

std::string damaged_trouble(std::int64_t damaged) {
  return damaged == 0 ? std::string() : fmt::format("{} payloads arrived damaged", damaged);
}

Session::Folder::Folder() {
  const char* const given = std::getenv("TMPDIR");
  const std::string place =
      std::filesystem::absolute(given == nullptr || *given == '\0' ? "/tmp" : given).string();
  path = place + "/fastcycle-bench-XXXXXX";
  if (mkdtemp(path.data()) == nullptr) {
    throw std::runtime_error("bench: cannot create a folder for temporary files in " + place +
                             ": " + std::strerror(errno) + "; TMPDIR says where");
  }
}

Session::Folder::~Folder() {
  std::error_code ignored;
  std::filesystem::remove_all(path, ignored);
}

Session::Session(const Options& options)
    : options_(options),
      load_(options.load),
      has_fifo_(options.is_fifo && measure::may_use_fifo()),
      signals_(block_stop_signals(), [this] {
        std::fputs(is_terminal() ? kClearLine : "", stderr);
        print_text(stderr, "stopping… (Ctrl-C again ends immediately)\n");
        is_stopped_ = true;
        runner_.request_end();
      }) {
  if (!options.raw_file.empty()) {
    // It has its name from the beginning, so that results can be read during the run.
    base::OutputFile file(options.raw_file);
    file.commit();
    const int descriptor = ::fcntl(file.descriptor(), F_DUPFD_CLOEXEC, 0);
    raw_.reset(descriptor < 0 ? nullptr : ::fdopen(descriptor, "w"));
    if (raw_ == nullptr) {
      throw std::runtime_error("bench: --raw " + options.raw_file.string() + ": " +
                               std::strerror(errno));
    }
    std::fputs("peer,mode,size,round,number,made_ns,sent_ns,arrived_ns\n", raw_.get());
  }
}

measure::Row Session::row(const std::string& peer, std::int64_t size) const {
  return {.peer = peer,
          .mode = options_.mode,
          .size = size,
          .warmup = options_.warmup,
          .interval_us = options_.interval_us};
}

measure::Plan Session::plan(std::int64_t size) const {
  return {.size = size,
          .count = options_.count,
          .warmup = options_.warmup,
          .interval_us = options_.interval_us,
          .is_fifo = options_.is_fifo,
          .slice_us = options_.slice_us,
          .stop = &is_stopped_};
}

Finished Session::run_application(const Json& json, const RunHooks& hooks) {
  Finished finished = runner_.run(json, folder_.path, hooks);
  for (const base::Refusal& refusal : finished.refusals) {
    if (reported_refusals_.insert(refusal.what).second) {
      print_to(stderr, "refused: {}; {}\n", refusal.what, refusal.remedy);
    }
  }
  return finished;
}

measure::Samples Session::samples_of(const std::string& name) const {
  measure::Samples samples;
  if (const std::string error = measure::read_samples(folder_.path + "/" + name, samples);
      !error.empty()) {
    throw std::runtime_error("bench: " + error);
  }
  return samples;
}

void Session::show_progress(const std::string& text) const {
  if (is_terminal()) {
    std::fputs(kClearLine, stderr);
    print_text(stderr, text);
    std::fflush(stderr);
  }
}

void Session::print_json(const measure::Row& row) {
  if (has_lost_output_) {
    return;
  }
  print_to(stdout, "{}\n", to_json(row));
  if (flush_output() != kDone) {
    has_lost_output_ = true;
    is_stopped_ = true;  // Nobody would see the rest.
  }
}

void Session::write_raw(const measure::Row& row, const measure::Samples& samples) {
  std::string text;
  for (const measure::Sample& sample : samples) {
    fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{},{}\n", row.peer, row.mode,
                   row.size, row.round, sample.number, sample.made_ns, sample.sent_ns,
                   sample.arrived_ns);
  }
  if (std::fwrite(text.data(), 1, text.size(), raw_.get()) != text.size() ||
      std::fflush(raw_.get()) != 0) {
    throw std::runtime_error("bench: --raw " + options_.raw_file.string() + ": " +
                             std::strerror(errno));
  }
}

std::optional<Finding> Session::measure_unless_stopped(const Step& step) const {
  try {
    Finding finding = step.measure();
    if (!is_stopped()) {
      return finding;
    }
  } catch (const std::exception&) {
    if (!is_stopped()) {
      throw;
    }
  }
  return std::nullopt;  // An interrupted measurement is invalid.
}

void Session::measure_point(const Mode& mode, std::size_t point, std::int64_t round,
                            std::vector<Line>& lines) {
  const std::vector<Step>& steps = mode.points[point].steps;
  for (std::size_t i = 0; i < steps.size() && !is_stopped(); ++i) {
    // Whatever one leaves behind (warm caches, a fast clock) does not always favour the same other.
    const std::size_t step = (i + static_cast<std::size_t>(round) - 1) % steps.size();
    show_progress(fmt::format("round {} of {}, point {} of {}: {}", round,
                              options_.first_round + options_.rounds - 1, point + 1,
                              mode.points.size(), steps[step].peer));
    const std::optional<Finding> found = measure_unless_stopped(steps[step]);
    show_progress({});
    if (!found) {
      return;
    }
    Finding finding = *found;
    finding.row.round = round;
    if (!finding.trouble.empty()) {
      print_to(stderr, "fastcycle bench: {}, {}: {}\n", finding.row.peer,
               size_text(finding.row.size), finding.trouble);
      has_failed_ = true;
    }
    if (options_.is_fifo) {
      finding.row.more += std::string(finding.row.more.empty() ? "" : ",") + "\"policy\":\"" +
                          (has_fifo_ ? "fifo" : "other") + "\"";
    }
    if (raw_ != nullptr) {
      write_raw(finding.row, finding.samples);
    }
    if (options_.is_json && !mode.after_round) {
      print_json(finding.row);
    }
    lines.push_back({point, step, std::move(finding.row)});
  }
}

void Session::tabulate(const Mode& mode, const std::vector<Line>& lines, Table& table) const {
  for (const Line& line : lines) {
    nlohmann::json json = nlohmann::json::parse(to_json(line.row));
    const Point& point = mode.points[line.point];
    for (const Line& other : lines) {
      if (other.point == line.point && other.row.peer == point.steps[line.step].floor) {
        const nlohmann::json floor = nlohmann::json::parse(to_json(other.row));
        const double its_figure = floor.value(mode.ratio_of, 0.0) * point.floor_times;
        if (json.contains(mode.ratio_of) && its_figure > 0) {
          json[kRatioKey] = json.at(mode.ratio_of).get<double>() / its_figure;
        }
      }
    }
    table.add({line.point, line.step}, std::move(json));
  }
}

int Session::run(const Mode& mode) {
  Table table(mode.columns, mode.is_upright);
  std::int64_t rounds = 0;
  const std::int64_t end = options_.first_round + options_.rounds;
  for (std::int64_t round = options_.first_round; round < end && !is_stopped(); ++round) {
    std::vector<Line> lines;
    for (std::size_t point = 0; point < mode.points.size() && !is_stopped(); ++point) {
      measure_point(mode, point, round, lines);
    }
    if (is_stopped()) {
      break;
    }
    if (mode.after_round) {
      std::vector<measure::Row> rows;
      for (const Line& line : lines) {
        rows.push_back(line.row);
      }
      mode.after_round(rows);
      for (std::size_t i = 0; i < rows.size(); ++i) {
        lines[i].row = rows[i];
        if (options_.is_json) {
          print_json(rows[i]);
        }
      }
    }
    tabulate(mode, lines, table);
    ++rounds;
  }
  if (!options_.is_json && rounds > 0) {
    print_to(stdout, "{}{}\n\n{}", mode.title,
             rounds > 1 ? fmt::format("; medians over {} rounds", rounds) : "", table.to_text());
  }
  if (has_lost_output_ || flush_output() != kDone) {
    return kFailed;
  }
  if (is_stopped()) {
    print_to(stderr, "fastcycle bench: stopped after {} of {} rounds\n", rounds, options_.rounds);
    return kFailed;
  }
  return has_failed_ ? kFailed : kDone;
}

}  // namespace fastcycle::tool::bench
