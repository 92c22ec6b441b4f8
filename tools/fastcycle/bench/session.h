#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "bench/application.h"
#include "bench/load.h"
#include "bench/options.h"
#include "bench/table.h"
#include "measure/floors.h"
#include "measure/row.h"
#include "measure/samples.h"
#include "stop_signals.h"

namespace fastcycle::tool::bench {

/// The result of one step of a round.
struct Finding {
  measure::Row row;
  measure::Samples samples = {};  ///< For --raw; may be empty.
  std::string trouble = {};       ///< Why the numbers are invalid; empty if they are valid.
};

/// One peer at one point.
struct Step {
  std::string peer;
  std::function<Finding()> measure;
  std::string floor = {};  ///< The peer of the same point to compare with; empty: none.
};

/// The steps compared within a round: the same size, the same number of subscribers, ….
struct Point {
  std::vector<Step> steps;
  double floor_times = 1;  ///< A ratio of 1 stands for this multiple of the floor.
};

/// A mode: what is measured, and how the results are displayed.
struct Mode {
  Json application;   ///< Of the first point.
  std::string title;  ///< Names the figures.
  std::vector<Point> points;
  std::vector<Column> columns;
  bool is_upright = false;          ///< One line for each column, for few rows of many figures.
  std::string ratio_of = "p50_us";  ///< The key whose value is divided by the floor's.
  /// Modifies the rows once a round is complete; without it each is printed at once.
  std::function<void(std::vector<measure::Row>&)> after_round = {};
};

/// One run of the benchmark: rounds over all points, each peer in turn, until all are complete or
/// Ctrl-C is pressed. Owns everything that must be cleaned up afterwards.
class Session {
 public:
  explicit Session(const Options& options);
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Measures and prints everything. Returns the exit code.
  int run(const Mode& mode);

  // For the steps of a mode.

  [[nodiscard]] const Options& options() const { return options_; }
  /// A row with the fields common to all rows.
  [[nodiscard]] measure::Row row(const std::string& peer, std::int64_t size) const;
  [[nodiscard]] measure::Plan plan(std::int64_t size) const;
  /// Runs an application, and prints each resource that the machine refused once to standard error.
  [[nodiscard]] Finished run_application(const Json& json, const RunHooks& hooks = {});
  [[nodiscard]] const std::string& folder() const { return folder_.path; }
  /// The samples that the component `name` wrote.
  [[nodiscard]] measure::Samples samples_of(const std::string& name) const;
  [[nodiscard]] bool is_stopped() const { return is_stopped_.load(); }

 private:
  struct Line {
    std::size_t point = 0;
    std::size_t step = 0;
    measure::Row row;
  };

  /// None if the session was stopped in the meantime.
  [[nodiscard]] std::optional<Finding> measure_unless_stopped(const Step& step) const;
  void measure_point(const Mode& mode, std::size_t point, std::int64_t round,
                     std::vector<Line>& lines);
  void tabulate(const Mode& mode, const std::vector<Line>& lines, Table& table) const;
  void show_progress(const std::string& text) const;
  /// Stops the session if standard output is closed.
  void print_json(const measure::Row& row);
  void write_raw(const measure::Row& row, const measure::Samples& samples);

  /// A temporary folder, removed with the session.
  class Folder {
   public:
    Folder();
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    ~Folder();
    std::string path;
  };
  struct Close {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  const Options& options_;
  const Folder folder_;
  const Load load_;
  const bool has_fifo_;
  Runner runner_;
  std::atomic<bool> is_stopped_{false};
  const StopSignals signals_;
  std::unique_ptr<std::FILE, Close> raw_;
  bool has_failed_ = false;
  bool has_lost_output_ = false;
  std::set<std::string> reported_refusals_;
};

/// `"damaged":0`, which every FastCycle row contains in addition.
[[nodiscard]] std::string damaged_json(std::int64_t damaged);
/// Reports damaged payloads; empty if there are none.
[[nodiscard]] std::string damaged_trouble(std::int64_t damaged);

}  // namespace fastcycle::tool::bench
