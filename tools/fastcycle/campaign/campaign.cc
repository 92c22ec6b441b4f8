#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>
#include <unistd.h>

#include "campaign/children.h"
#include "campaign/judge.h"
#include "campaign/page.h"
#include "campaign/plan.h"
#include "campaign/shrink.h"
#include "campaign/summary.h"
#include "command.h"
#include "configuration.h"
#include "duration.h"
#include "loading/component_library.h"
#include "loading/pinned_libraries.h"
#include "option_values.h"
#include "print.h"
#include "redrawn_line.h"
#include "report_file.h"
#include "stop_signals.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;
using campaign::DrawnFault;
using campaign::Failure;
using campaign::Faults;
using campaign::SeedResult;
using campaign::Verdict;
using nlohmann::ordered_json;

struct CampaignOptions {
  Configuration configuration;
  fs::path plan;
  std::uint64_t seeds = 100;
  std::uint64_t first_seed = 1;
  std::vector<std::string> judges;
  unsigned jobs = std::max(1U, std::thread::hardware_concurrency());
  fs::path out = "campaign";
  std::string limit;  ///< Of application time.
  std::string wall_limit = "60s";
  std::size_t shrink_runs = 300;
  std::size_t most_failures = 16;
  fs::path junit;
  bool is_without_logs = false;
  bool is_quiet = false;
};

std::optional<std::string> content_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return stream ? std::optional(std::move(text).str()) : std::nullopt;
}

/// @errors  std::runtime_error, which ends the campaign: what it would find is not to be trusted.
void write_or_end(const fs::path& file, const std::string& text) {
  if (const std::string why = ReportFile(file).write(text); !why.empty()) {
    throw std::runtime_error(fmt::format("{} cannot be written: {}", file.string(), why));
  }
}

int print_wrong(const std::string& what) {
  print_to(stderr, "fastcycle campaign: {}; nothing was started\n", what);
  return kWrong;
}

std::string quoted(const std::string& word) {
  if (word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                             "_-./=,:+@%") == std::string::npos &&
      !word.empty()) {
    return word;
  }
  std::string text = "'";
  for (const char c : word) {
    text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  }
  return text + "'";
}

/// `word`, or, if it ends with the name of a file that is there, `=FILE`, with its whole path: it
/// is to be read by a run in another folder.
std::string from_anywhere(const std::string& word) {
  const auto value = word.find('=') + 1;
  const fs::path file = word.substr(value);
  std::error_code error;
  return file.is_relative() && fs::exists(file, error) && !file.empty()
             ? word.substr(0, value) + fs::absolute(file).string()
             : word;
}

/// The words of the configuration, as a run takes them; with `is_elsewhere` one that works in
/// another folder.
std::vector<std::string> words_of(const Configuration& configuration, bool is_elsewhere = false) {
  const auto path_of = [&](const fs::path& file) {
    return is_elsewhere ? fs::absolute(file).string() : file.string();
  };
  const auto text_of = [&](const std::string& word) {
    return is_elsewhere ? from_anywhere(word) : word;
  };
  std::vector<std::string> words = {path_of(configuration.load.file)};
  const auto add = [&](const char* option, const std::string& value) {
    words.insert(words.end(), {option, value});
  };
  for (const fs::path& overlay : configuration.load.overlays) {
    add("--overlay", path_of(overlay));
  }
  for (const std::string& set : configuration.load.sets) {
    add("--set", text_of(set));
  }
  for (const std::string& variable : configuration.load.variables) {
    add("--var", text_of(variable));
  }
  for (const std::string& isolated : configuration.load.isolated) {
    add("--isolate", isolated);
  }
  for (const fs::path& folder : configuration.library_path) {
    add("--library-path", path_of(folder));
  }
  if (configuration.load_timeout != Configuration().load_timeout) {
    add("--load-timeout", configuration.load_timeout);
  }
  return words;
}

/// One campaign: runs seeds, shrinks what failed, writes what was found.
class Campaign {
 public:
  Campaign(const CampaignOptions& options, config::ApplicationDescription application,
           campaign::Plan plan, std::vector<campaign::Judge> judges, std::string plan_text)
      : options_(options),
        application_(std::move(application)),
        plan_(std::move(plan)),
        judges_(std::move(judges)),
        plan_text_(std::move(plan_text)),
        children_(options.jobs, *parse_duration(options.wall_limit)) {}
  Campaign(const Campaign&) = delete;
  Campaign& operator=(const Campaign&) = delete;
  ~Campaign() {
    if (folder_ >= 0) {
      ::close(folder_);
    }
  }

  void stop() noexcept { children_.stop(); }

  int run() {
    if (const std::string why = open(); !why.empty()) {
      return print_wrong(why);
    }
    if (!run_seeds()) {
      return kWrong;
    }
    shrink_failures();
    return finish();
  }

 private:
  /// The SHA-256 of each component library and of the libraries it needs: the code that runs.
  [[nodiscard]] ordered_json libraries() const {
    const host::LibraryLoader loader(
        host::library_folders(application_, options_.configuration.library_path));
    auto sums = ordered_json::object();
    for (const config::ComponentDescription& component : application_.components) {
      const fs::path file = loader.file_of(component.library);
      if (file.empty() || sums.contains(component.library)) {
        continue;
      }
      auto& its = sums[component.library];
      its = {host::sha256_of(file)};
      for (const host::NeededLibrary& needed : host::needed_libraries(file)) {
        its.push_back(host::sha256_of(needed.file));
      }
    }
    return sums;
  }

  /// What identifies a campaign, besides the number of seeds.
  [[nodiscard]] ordered_json identity() const {
    auto judges = ordered_json::array();
    for (const campaign::Judge& judge : judges_) {
      judges.push_back(judge.text());
    }
    return {{"application", application_.effective.to_json()},
            {"libraries", libraries()},
            {"options", words_of(options_.configuration)},
            {"plan", plan_text_},
            {"judges", judges},
            {"for", options_.limit}};
  }

  [[nodiscard]] fs::path identity_file() const { return options_.out / "campaign.json"; }
  [[nodiscard]] fs::path results_file() const { return options_.out / "results.jsonl"; }

  [[nodiscard]] ReportFile junit_file() const {
    std::vector<fs::path> inputs = options_.configuration.load.overlays;
    inputs.insert(inputs.end(), {options_.configuration.load.file, options_.plan, identity_file(),
                                 results_file()});
    for (const config::ComponentDescription& component : application_.components) {
      inputs.emplace_back(component.place.file);  // Of an included application.
    }
    return ReportFile(options_.junit, std::move(inputs));
  }

  /// Makes the folder and takes it for this campaign alone; why not, or nothing.
  std::string take_folder() {
    const std::string name = options_.out.string();
    std::error_code error;
    fs::create_directories(options_.out, error);
    if (error) {
      return fmt::format("{}: {}", name, error.message());
    }
    folder_ = ::open(name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder_ < 0) {
      return fmt::format("{}: {}", name, std::generic_category().message(errno));
    }
    // Of the folder itself: a file to lock would have to be created in one that may be another's.
    // Some network file systems have no such lock; there nothing keeps two campaigns apart.
    if (::flock(folder_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      return name +
             " is in use by another campaign; wait until that has ended, or name another --out";
    }
    const bool is_empty = fs::is_empty(options_.out, error);
    if (error) {
      return fmt::format("{}: {}", name, error.message());
    }
    if (!is_empty && !fs::exists(identity_file(), error)) {
      return name +
             " is not empty and contains no campaign; name a new folder with --out, or empty it";
    }
    return {};
  }

  /// Makes the folder, or goes on with what is there; why not, or nothing.
  std::string open() {
    if (std::string why = take_folder(); !why.empty()) {
      return why;
    }
    if (const std::string why = junit_file().find_obstacle(); !why.empty()) {
      return options_.junit.string() + " cannot be written: " + why;  // It may be in that folder.
    }
    const fs::path known = identity_file();
    const ordered_json own = identity();
    if (const auto text = content_of(known)) {
      const ordered_json other = ordered_json::parse(*text, nullptr, false);
      for (const auto& [key, value] : own.items()) {
        if (!other.is_object() || !other.contains(key) || other[key] != value) {
          return fmt::format(
              "{} contains another campaign: its {} differ{}; use another --out, or remove that "
              "folder",
              options_.out.string(), key == "for" ? "--for" : key,
              key == "libraries" || key == "options" || key == "judges" ? "" : "s");
        }
      }
    } else if (const std::string why = ReportFile(known).write(own.dump(2) + "\n"); !why.empty()) {
      return fmt::format("{}: {}", known.string(), why);
    }
    std::error_code error;
    fs::create_directories(options_.out / "runs", error);
    if (error) {
      return fmt::format("{}: {}", (options_.out / "runs").string(), error.message());
    }
    std::ifstream lines(results_file());
    for (std::string line; std::getline(lines, line);) {
      try {
        SeedResult result = campaign::result_of(line);
        results_[result.seed] = std::move(result);
      } catch (const ordered_json::exception&) {
        break;  // The last line, which was being written when the campaign was ended.
      }
    }
    // Written again: without a half line.
    std::string text;
    for (const auto& [seed, result] : results_) {
      text += campaign::to_line(result) + "\n";
    }
    if (const std::string why = ReportFile(results_file()).write(text); !why.empty()) {
      return fmt::format("{}: {}", results_file().string(), why);
    }
    return {};
  }

  [[nodiscard]] std::vector<std::string> command(const fs::path& overlay,
                                                 bool is_elsewhere = false) const {
    std::vector<std::string> words = {"run"};
    const auto configuration = words_of(options_.configuration, is_elsewhere);
    words.insert(words.end(), configuration.begin(), configuration.end());
    words.insert(words.end(), {"--overlay", overlay.string(), "--clock", "simulated"});
    if (!options_.limit.empty()) {
      words.insert(words.end(), {"--for", options_.limit});
    }
    return words;
  }

  /// Writes what a run needs into `folder`, where it works: what its components write is there too.
  ChildProgram begin(const fs::path& relative, const Faults& faults, std::uint64_t seed,
                     const fs::path& log = {}) const {
    const fs::path folder = fs::absolute(relative);
    fs::remove_all(folder);
    fs::create_directories(folder);
    write_or_end(folder / "overlay.json", campaign::overlay_of(faults, seed).dump(2) + "\n");
    ChildProgram program{.arguments = command(folder / "overlay.json", true),
                         .folder = folder,
                         .output = folder / "output.txt"};
    program.arguments.insert(program.arguments.begin(), "/proc/self/exe");
    for (const std::string& word :
         {std::string("--workers"), std::string("1"), std::string("--quiet"),
          std::string("--report"), (folder / "report.json").string()}) {
      program.arguments.push_back(word);
    }
    if (!log.empty()) {
      program.arguments.insert(program.arguments.end(), {"--record", log.string()});
    }
    return program;
  }

  [[nodiscard]] Verdict judge(const fs::path& folder, const ChildEnd& end) const {
    Verdict verdict;
    const auto text = content_of(folder / "report.json");
    if (text) {
      verdict.report = ordered_json::parse(*text, nullptr, false);
    } else if (!end.is_late && end.signal == 0) {
      // Where there is no room for a report, the run has not failed: it cannot be judged.
      write_or_end(folder / "report.json", std::string(std::size_t{256} << 10U, ' '));
    }
    if (end.is_late) {
      verdict.way = "no end within " + options_.wall_limit;
    } else if (end.signal != 0) {
      verdict.way = fmt::format("signal {} ({})", end.signal, strsignal(end.signal));
    } else if (end.exit_code != 0) {
      verdict.way = fmt::format("exit code {}", end.exit_code);
    } else if (!verdict.report.is_object()) {
      verdict.way = "no report";
    }
    verdict.how = verdict.way;
    for (const campaign::Judge& judge : judges_) {
      if (verdict.has_failed()) {
        break;
      }
      verdict.how = judge.find_fault(verdict.report);
      verdict.way = verdict.how.empty() ? "" : judge.text();
    }
    return verdict;
  }

  /// False if the plan does not fit the application: the error has been printed.
  bool run_seeds() {
    std::vector<std::uint64_t> seeds;
    for (std::uint64_t i = 0; i < options_.seeds; ++i) {
      if (!results_.contains(options_.first_seed + i)) {
        seeds.push_back(options_.first_seed + i);
      }
    }
    if (seeds.size() < options_.seeds) {
      print_line(fmt::format("{} of {} seeds are done already", options_.seeds - seeds.size(),
                             options_.seeds));
    }
    bool is_wrong = false;
    std::ofstream lines(results_file(), std::ios::app);
    const auto began = std::chrono::steady_clock::now();
    std::size_t done = 0;
    std::size_t failed = 0;
    const auto folder_of = [&](std::size_t i) {
      return options_.out / "runs" / ("seed_" + std::to_string(seeds[i]));
    };
    children_.run(
        seeds.size(),
        [&](std::size_t i) { return begin(folder_of(i), plan_.draw(seeds[i]), seeds[i]); },
        [&](std::size_t i, const ChildEnd& end) {
          if (end.exit_code == kWrong && !is_wrong) {
            if (!fs::exists(folder_of(i) / "overlay.json")) {
              throw std::runtime_error(
                  fmt::format("{} no longer exists", (folder_of(i) / "overlay.json").string()));
            }
            is_wrong = true;
            clear_line();
            print_text(stderr, content_of(folder_of(i) / "output.txt").value_or(""));
            print_to(stderr,
                     "fastcycle campaign: seed {} cannot be run: its faults do not fit the "
                     "application, see {}\n",
                     seeds[i], (folder_of(i) / "overlay.json").string());
            children_.stop();
          }
          if (is_wrong) {
            return;
          }
          const Verdict verdict = judge(folder_of(i), end);
          SeedResult result{.seed = seeds[i],
                            .faults = plan_.draw(seeds[i]),
                            .way = verdict.way,
                            .how = verdict.how,
                            .wall_s = end.wall_s};
          if (!(lines << campaign::to_line(result) << std::endl)) {
            throw std::runtime_error(fmt::format("{} cannot be written", results_file().string()));
          }
          ++done;
          if (verdict.has_failed()) {
            ++failed;
            clear_line();
            print_line(fmt::format("seed {}: {}", seeds[i], verdict.how));
            keep_results(folder_of(i));
          } else {
            fs::remove_all(folder_of(i));
          }
          results_[seeds[i]] = std::move(result);
          show(began, done, failed, seeds.size());
        });
    clear_line();
    return !is_wrong;
  }

  /// For the folder of a failed run. Its components' files may be large, and can be reproduced.
  static void keep_results(const fs::path& folder) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      if (name != "overlay.json" && name != "report.json" && name != "output.txt") {
        fs::remove_all(entry.path());
      }
    }
  }

  std::vector<Verdict> try_all(const std::vector<Faults>& lists, std::uint64_t seed) {
    std::vector<Verdict> verdicts(lists.size());
    std::vector<bool> are_there(lists.size());
    const auto folder_of = [&](std::size_t i) {
      return options_.out / "runs" / ("shrink_" + std::to_string(i));
    };
    children_.run(
        lists.size(), [&](std::size_t i) { return begin(folder_of(i), lists[i], seed); },
        [&](std::size_t i, const ChildEnd& end) {
          verdicts[i] = judge(folder_of(i), end);
          are_there[i] = true;
          fs::remove_all(folder_of(i));
        });
    const auto missing = std::ranges::find(are_there, false);
    verdicts.resize(static_cast<std::size_t>(missing - are_there.begin()));
    return verdicts;
  }

  /// Of failures that the same entries of the plan led to, in the same way, the one with the fewest
  /// faults.
  [[nodiscard]] std::vector<const SeedResult*> choose() const {
    std::map<std::pair<std::string, std::set<std::size_t>>, const SeedResult*> groups;
    for (const auto& [seed, result] : results_) {
      if (result.way.empty()) {
        continue;
      }
      std::set<std::size_t> sources;
      for (const DrawnFault& fault : result.faults) {
        sources.insert(fault.source);
      }
      const SeedResult*& known = groups[{result.way, sources}];
      if (known == nullptr || result.faults.size() < known->faults.size()) {
        known = &result;
      }
    }
    std::vector<const SeedResult*> chosen;
    for (const auto& [key, result] : groups) {
      chosen.push_back(result);
    }
    std::ranges::sort(
        chosen, {}, [](const SeedResult* one) { return std::pair(one->faults.size(), one->seed); });
    return chosen;
  }

  void shrink_failures() {
    const std::vector<const SeedResult*> chosen = choose();
    for (const SeedResult* const result : chosen) {
      if (children_.is_stopped() || failures_.size() >= options_.most_failures) {
        break;
      }
      if (campaign::fails_without_faults(result->way, failures_)) {
        continue;  // Nothing is left of this one either.
      }
      print_line(fmt::format("shrinking seed {}: {}", result->seed, result->how));
      const campaign::TryAll try_them = [&](const std::vector<Faults>& lists) {
        return try_all(lists, result->seed);
      };
      // Run again, because its report lists the affected messages.
      const std::vector<Verdict> first = try_all({result->faults}, result->seed);
      if (first.empty()) {
        break;
      }
      if (first.front().way != result->way) {
        print_line(fmt::format("seed {} did not fail in the same way again: {}", result->seed,
                               first.front().has_failed() ? first.front().how : "it passed"));
        continue;
      }
      campaign::Shrunk shrunk =
          campaign::shrink(result->faults, first.front(), try_them, options_.shrink_runs);
      Failure failure{.seed = result->seed,
                      .faults = std::move(shrunk.faults),
                      .way = shrunk.verdict.way,
                      .how = shrunk.verdict.how,
                      .runs = shrunk.runs + 1,
                      .is_smallest = shrunk.is_smallest,
                      .overlay = {},
                      .log = {},
                      .command = {}};
      if (failure.faults.empty()) {
        print_line(fmt::format("seed {} {}", failure.seed, campaign::kWithoutFaults));
      }
      if (std::ranges::none_of(failures_, [&](const Failure& other) {
            return campaign::is_alike(failure, other);
          })) {
        keep(std::move(failure));
      }
    }
  }

  /// Writes the overlay that repeats a failure, and runs that once more with a log.
  void keep(Failure failure) {
    const std::string name = "failure_" + std::to_string(failures_.size() + 1);
    const fs::path overlay = options_.out / (name + ".json");
    write_or_end(overlay, campaign::overlay_of(failure.faults, failure.seed).dump(2) + "\n");
    failure.overlay = overlay.string();
    failure.command = "fastcycle";
    for (const std::string& word : command(overlay)) {
      failure.command += " " + quoted(word);
    }
    if (!options_.is_without_logs) {
      failure.log = write_log(failure, name);
    }
    failures_.push_back(std::move(failure));
  }

  /// Runs a failure once more, with a log; where that is, or nothing.
  std::string write_log(const Failure& failure, const std::string& name) {
    const fs::path log = options_.out / (name + ".mcap");
    const fs::path folder = options_.out / "runs" / name;
    fs::remove(log);
    int exit_code = 0;
    const auto run_with = [&](const fs::path& record) {
      children_.run(
          1, [&](std::size_t) { return begin(folder, failure.faults, failure.seed, record); },
          [&](std::size_t, const ChildEnd& end) { exit_code = end.exit_code; });
    };
    run_with(fs::absolute(log));
    if (exit_code == kWrong) {  // Then it records itself, into the folder where it works.
      run_with({});
      for (const auto& entry : fs::directory_iterator(folder)) {
        if (entry.path().extension() == ".mcap") {
          fs::rename(entry.path(), log);
          break;
        }
      }
    }
    fs::remove_all(folder);
    return fs::exists(log) ? log.string() : std::string();
  }

  int finish() {
    campaign::Summary summary{.application = options_.configuration.load.file.string(),
                              .plan = options_.plan.string(),
                              .seeds = options_.seeds,
                              .judges = {},
                              .results = {},
                              .failures = failures_,
                              .wall_s = 0};
    for (const campaign::Judge& judge : judges_) {
      summary.judges.push_back(judge.text());
    }
    for (const auto& [seed, result] : results_) {
      if (seed >= options_.first_seed && seed - options_.first_seed < options_.seeds) {
        summary.wall_s += result.wall_s;
        summary.results.push_back(result);
      }
    }
    std::string problems;
    const auto note = [&](const fs::path& file, const std::string& why) {
      if (!why.empty()) {
        problems += fmt::format("fastcycle campaign: {} was not written: {}\n", file.string(), why);
      }
    };
    const auto write = [&](const fs::path& file, const std::string& text) {
      note(file, ReportFile(file).write(text));
    };
    write(options_.out / "summary.json", campaign::to_json(summary).dump(2) + "\n");
    write(options_.out / "index.html", campaign::to_page(summary));
    note(options_.junit, junit_file().write(campaign::to_junit(summary)));
    print_text(stdout, campaign::to_text(summary));
    print_text(stderr, problems);
    const bool is_complete = summary.results.size() == options_.seeds;
    if (!is_complete) {
      print_to(stderr,
               "fastcycle campaign: stopped after {} of {} seeds; repeat the command to continue\n",
               summary.results.size(), options_.seeds);
    }
    const int flushed = flush_output();
    return summary.failed() > 0 || !is_complete || !problems.empty() ? kFailed : flushed;
  }

  void print_line(const std::string& line) const {
    if (!options_.is_quiet) {
      print_to(stderr, "{}\n", line);
    }
  }

  [[nodiscard]] bool is_line_shown() const { return !options_.is_quiet && isatty(STDERR_FILENO); }
  void clear_line() const {
    if (is_line_shown()) {
      std::fputs(kClearLine, stderr);
    }
  }
  void show(std::chrono::steady_clock::time_point began, std::size_t done, std::size_t failed,
            std::size_t all) const {
    if (is_line_shown()) {
      const double wall_s =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
      clear_line();
      print_to(stderr, "{} of {} seeds, {} failed, {:.0f} s left", done, all, failed,
               wall_s / static_cast<double>(done) * static_cast<double>(all - done));
      std::fflush(stderr);
    }
  }

  const CampaignOptions& options_;
  const config::ApplicationDescription application_;
  const campaign::Plan plan_;
  const std::vector<campaign::Judge> judges_;
  const std::string plan_text_;
  Children children_;
  int folder_ = -1;                              ///< Locked.
  std::map<std::uint64_t, SeedResult> results_;  ///< By seed.
  std::vector<Failure> failures_;
};

int run_campaign(const CampaignOptions& options) {
  const auto text = content_of(options.plan);
  if (!text) {
    return print_wrong("the plan " + options.plan.string() + " cannot be read");
  }
  std::vector<std::string> errors;
  const auto plan = campaign::Plan::read(*text, options.plan.string(), errors);
  std::vector<campaign::Judge> judges;
  for (const std::string& condition : options.judges) {
    std::string why;
    if (auto judge = campaign::Judge::parse(condition, why)) {
      judges.push_back(std::move(*judge));
    } else {
      errors.push_back("--judge: " + why);
    }
  }
  if (!errors.empty()) {
    for (const std::string& error : errors) {
      print_to(stderr, "{}\n", error);
    }
    return print_wrong(fmt::format("{} error{}", errors.size(), errors.size() == 1 ? "" : "s"));
  }
  config::Problems problems;
  auto application = config::load(options.configuration.load, problems);
  if (problems.has_errors() && !may_start(problems, options.configuration.load.file.string())) {
    return kWrong;
  }
  const sigset_t signals = block_stop_signals();
  try {
    Campaign campaign(options, std::move(application), *plan, std::move(judges), *text);
    const StopSignals stop(signals, [&campaign] { campaign.stop(); });
    return campaign.run();
  } catch (const std::exception& error) {
    print_to(stderr, "fastcycle campaign: {}\n", error.what());
    return kFailed;
  }
}

}  // namespace

Command add_campaign(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "campaign", "Run an application with many sets of faults, and reduce those that fail");
  line->footer(examples(
      "  fastcycle campaign app.json --plan plan.json --seeds 500 --judge 'collisions == 0'\n"
      "  fastcycle campaign app.json --plan plan.json --for 10s --out found --junit found.xml\n"
      "\n"
      "Each seed draws faults from the plan for one run in simulated time. A run fails if a\n"
      "condition of --judge is not met, its exit code is not 0, a signal ends it, or it exceeds\n"
      "its limit. Failures are reduced to the fewest faults and messages; OUT contains an\n"
      "overlay and a log of each, summary.json, and the page index.html. After Ctrl-C, the same\n"
      "command continues.\n"
      "Exit codes: 0 all passed, 1 some failed or did not run, 2 wrong input (nothing was\n"
      "started).\n"));
  const auto options = std::make_shared<CampaignOptions>();
  options->configuration.add_to(*line);
  line->add_option("--plan", options->plan, "The plan: the faults to draw from, JSON")
      ->required()
      ->type_name("FILE");
  line->add_option("--seeds", options->seeds, "Number of seeds (100)")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{10'000'000}))
      ->type_name("N");
  line->add_option("--first-seed", options->first_seed, "The first seed (1)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  line->add_option("--judge", options->judges,
                   "Condition on the report of each run: 'collisions == 0' (repeatable)")
      ->allow_extra_args(false)
      ->type_name("CONDITION");
  line->add_option("--jobs", options->jobs, "Number of parallel runs (that of CPUs)")
      ->check(CLI::Range(1U, 1024U))
      ->type_name("N");
  line->add_option("--out", options->out, "The output folder (campaign)")->type_name("DIR");
  line->add_option("--for", options->limit, "End each run after this application time: 10s")
      ->check(is_time())
      ->type_name("TIME");
  line->add_option(
          "--limit", options->wall_limit,
          "Time limit of each run, by the machine's clock; exceeding it is a failure (60s)")
      ->check(is_time())
      ->type_name("TIME");
  line->add_option("--shrink-runs", options->shrink_runs,
                   "Maximum number of runs to reduce one failure (300)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  line->add_option("--most-failures", options->most_failures,
                   "Maximum number of different failures to reduce (16)")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  line->add_option("--junit", options->junit, "Write the results as JUnit XML, for CI")
      ->type_name("FILE");
  line->add_flag("--no-logs", options->is_without_logs, "Write no logs of the reduced failures");
  line->add_flag("--quiet", options->is_quiet, "Print no progress line and no line per failure");
  return {line, [options] { return run_campaign(*options); }};
}

}  // namespace fastcycle::tool
