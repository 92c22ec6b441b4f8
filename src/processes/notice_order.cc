#include "processes/notice_order.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/prctl.h>

#include "base/clock.h"
#include "processes/process_plan.h"

namespace fastcycle::processes {

using host::Notice;
using segment::ProcessIndex;

namespace {

constexpr std::size_t kMaxText = 60'000;
constexpr unsigned kMostOfOne = 64;            ///< Notices taken from one process per pass.
constexpr std::int64_t kLookNs = 100'000'000;  ///< Maximum time between two checks.

std::string to_record(const Notice& notice) {
  return fmt::format("{}{} {} {}", static_cast<char>(notice.kind), notice.process, notice.component,
                     notice.text);
}

/// None if it is no valid notice: its writer may be faulty.
std::optional<Notice> from_record(std::string_view record) {
  constexpr std::string_view kKinds = "gcrbmlejnotyafipvwd";
  if (record.empty() || kKinds.find(record.front()) == std::string_view::npos) {
    return std::nullopt;
  }
  Notice notice{.kind = static_cast<Notice::Kind>(record.front())};
  record.remove_prefix(1);
  for (std::uint32_t* const number : {&notice.process, &notice.component}) {
    const auto [end, error] =
        std::from_chars(record.data(), record.data() + record.size(), *number);
    if (error != std::errc() || end == record.data() + record.size() || *end != ' ') {
      return std::nullopt;
    }
    record.remove_prefix(static_cast<std::size_t>(end - record.data()) + 1);
  }
  notice.text = std::string(record);
  return notice;
}

/// Whether any process may send this; the others only the main one sends.
bool is_sent_by_all(Notice::Kind kind) {
  return kind != Notice::Kind::kGone && kind != Notice::Kind::kCame &&
         kind != Notice::Kind::kModesBegun && kind != Notice::Kind::kModeEntered;
}

}  // namespace

NoticeOrder::NoticeOrder(const segment::Wire& wire, ProcessIndex process, std::uint32_t incarnation,
                         bool is_simulated, host::Peers& peers)
    : wire_(wire),
      process_(process),
      incarnation_(incarnation),
      is_simulated_(is_simulated),
      peers_(peers),
      notices_(wire, process, incarnation) {
  for (ProcessIndex one = ProcessPlan::kMain; one < wire.plan().processes; ++one) {
    recipients_.insert(one);
    notices_.follow(one, 1, 0);
  }
}

NoticeOrder::~NoticeOrder() {
  stop();
}

void NoticeOrder::stop() {
  if (thread_.joinable()) {
    thread_.request_stop();
    sleepers_.wake_one();
    thread_.join();
  }
}

void NoticeOrder::send_notice(Notice::Kind kind, std::uint32_t component, const std::string& text) {
  if (text.size() > kMaxText) {
    throw std::length_error(fmt::format("{} bytes are sent to other processes; at most {} can be",
                                        text.size(), kMaxText));
  }
  const Notice notice{.kind = kind, .process = process_, .component = component, .text = text};
  if (!is_simulated_ && process_ != ProcessPlan::kMain) {
    notices_.send(to_record(notice));
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    own_.push_back(notice);
  }
  sleepers_.wake_one();
}

void NoticeOrder::wake() {
  sleepers_.wake_one();
}

void NoticeOrder::begin() {
  if (incarnation_ > 1) {
    take_snapshot();
  }
  if (!is_simulated_) {
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }
}

/// Catches up with the main process.
void NoticeOrder::take_snapshot() {
  const auto snapshot = notices_.snapshot_of(ProcessPlan::kMain);
  if (!snapshot) {
    return;  // No notices so far.
  }
  const auto json = nlohmann::json::parse(*snapshot);
  recipients_ = json.at("recipients").get<std::set<std::uint32_t>>();
  for (const auto& one : json.at("read")) {
    notices_.follow(one.at(0).get<ProcessIndex>(), one.at(1), one.at(2));
  }
  peers_.take_snapshot(json.at("state").get<std::string>());
}

// ---- Live ----

void NoticeOrder::serve(const std::stop_token& stop) {
  prctl(PR_SET_NAME, "notices");
  while (!stop.stop_requested()) {
    sleepers_.announce(0);
    const std::vector<base::WatchedWord> words = watched_words();
    const std::int64_t next_ns = peers_.on_look ? peers_.on_look() : base::kNever;
    if (stop.stop_requested() || look()) {
      sleepers_.withdraw(0);
    } else {
      sleepers_.sleep(0, std::min(next_ns, base::monotonic_ns() + kLookNs), words);
    }
  }
}

std::vector<base::WatchedWord> NoticeOrder::watched_words() const {
  const auto& changes = wire_.changes();
  std::vector<base::WatchedWord> words{
      {.word = &changes, .seen = changes.load(std::memory_order_seq_cst)}};
  if (process_ != ProcessPlan::kMain) {
    words.push_back(notices_.word_of(ProcessPlan::kMain));
    return words;
  }
  for (ProcessIndex one = ProcessPlan::kMain + 1; one < wire_.plan().processes; ++one) {
    if (words.size() < base::Sleepers::kMaxWatched && notices_.incarnation_of(one) != 0) {
      words.push_back(notices_.word_of(one));
    }
  }
  return words;
}

/// Takes pending notices; false if there were none.
bool NoticeOrder::look() {
  if (process_ == ProcessPlan::kMain) {
    return look_as_main();
  }
  bool has_taken = false;
  while (const auto record = notices_.next(ProcessPlan::kMain)) {
    if (const auto notice = from_record(*record)) {
      take(*notice);
    }
    has_taken = true;
  }
  if (notices_.take_loss()) {  // This process was stopped for long.
    take_snapshot();
  }
  return has_taken;
}

bool NoticeOrder::look_as_main() {
  std::vector<Notice> own;
  {
    const std::lock_guard lock(mutex_);
    own.swap(own_);
  }
  bool has_taken = !own.empty();
  for (const Notice& notice : own) {
    put_in_order(notice);
  }
  for (ProcessIndex one = ProcessPlan::kMain + 1; one < wire_.plan().processes; ++one) {
    // Bounded, so that a process that floods does not starve the others.
    for (unsigned i = 0; i < kMostOfOne; ++i) {
      const auto record = notices_.next(one);
      if (!record) {
        break;
      }
      has_taken = true;
      auto notice = from_record(*record);
      if (notice && is_sent_by_all(notice->kind)) {
        notice->process = one;  // Overrides the sender's claim.
        put_in_order(*notice);
      }
    }
  }
  return look_for_changes() || has_taken;
}

/// The notice that a process has ended; `is_back`: its next incarnation exists already.
Notice NoticeOrder::gone(ProcessIndex process, bool is_back) const {
  const bool is_coming = wire_.restarting(process).load(std::memory_order_seq_cst) != 0;
  return {.kind = Notice::Kind::kGone,
          .process = process,
          .text = is_back || is_coming ? Notice::kRestarts : ""};
}

/// Whether an expected process will not come: its last incarnation was too short to be seen here.
bool NoticeOrder::is_lost(ProcessIndex process) const {
  const auto is_absent = [&] {
    return wire_.restarting(process).load(std::memory_order_seq_cst) == 0 &&
           wire_.incarnation(process).load(std::memory_order_seq_cst) == 0;
  };
  // Checked twice, since it may appear between the two loads.
  return coming_.contains(process) && is_absent() && is_absent();
}

/// Reports processes that have ended, after all their notices, and those that came.
bool NoticeOrder::look_for_changes() {
  if (wire_.incarnation(ProcessPlan::kMain).load(std::memory_order_seq_cst) == 0) {
    return false;  // Not all processes exist yet.
  }
  bool has_delivered = false;
  for (ProcessIndex one = ProcessPlan::kMain + 1; one < wire_.plan().processes; ++one) {
    const std::uint32_t now = wire_.incarnation(one).load(std::memory_order_seq_cst);
    const std::uint32_t known = notices_.incarnation_of(one);
    if (now == known && !is_lost(one)) {
      continue;
    }
    has_delivered = true;
    if (now == known) {
      coming_.erase(one);
      put_in_order(gone(one, false));
      continue;
    }
    notices_.follow(one, now, 0);
    if (known != 0) {
      const Notice notice = gone(one, now != 0);
      put_in_order(notice);
      if (now == 0 && notice.text == Notice::kRestarts) {
        coming_.insert(one);
      }
    }
    if (now != 0) {
      coming_.erase(one);
      put_in_order({.kind = Notice::Kind::kCame, .process = one});
    }
  }
  return has_delivered;
}

void NoticeOrder::put_in_order(const Notice& notice) {
  if (notice.kind == Notice::Kind::kNews || notice.kind == Notice::Kind::kLine ||
      notice.kind == Notice::Kind::kDumpAsked || notice.kind == Notice::Kind::kFollows) {
    take(notice);  // Only the main process uses it.
    return;
  }
  notices_.send(to_record(notice));
  take(notice);
  put_snapshot();
}

void NoticeOrder::take(const Notice& notice) {
  if (notice.kind == Notice::Kind::kGone) {
    recipients_.erase(notice.process);
  } else if (notice.kind == Notice::Kind::kCame) {
    recipients_.insert(notice.process);
  }
  peers_.on_notice(notice);
}

/// By the main process, when all notices so far were taken.
void NoticeOrder::put_snapshot() {
  nlohmann::json read = nlohmann::json::array();
  if (is_simulated_) {
    for (ProcessIndex one = ProcessPlan::kMain; one < wire_.plan().processes; ++one) {
      read.push_back({one, notices_.incarnation_of(one), notices_.position_of(one)});
    }
  } else {
    read.push_back({ProcessPlan::kMain, incarnation_, notices_.sent()});
  }
  const std::string snapshot =
      nlohmann::json{{"recipients", recipients_}, {"read", read}, {"state", peers_.make_snapshot()}}
          .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (!notices_.put_snapshot(snapshot) && peers_.on_snapshot_refused) {
    peers_.on_snapshot_refused(snapshot.size(), segment::SnapshotWords::kBytes);
  }
}

// ---- Simulated time ----

NoticeOrder::Sent NoticeOrder::send() {
  std::vector<Notice> own;
  {
    const std::lock_guard lock(mutex_);
    own.swap(own_);
  }
  for (const Notice& notice : own) {
    notices_.send(to_record(notice));
  }
  return {.words = notices_.sent(), .incarnation = incarnation_};
}

bool NoticeOrder::take(const std::vector<Sent>& sent) {
  std::multimap<std::uint32_t, Notice> all;  // By component; of one, in order of arrival.
  for (ProcessIndex one = ProcessPlan::kMain; one < wire_.plan().processes; ++one) {
    const bool is_there = sent[one].incarnation != 0;
    const bool is_new = is_there && notices_.incarnation_of(one) != sent[one].incarnation;
    if (recipients_.contains(one) && (!is_there || is_new)) {
      take(gone(one, is_new));
    }
    if (is_new) {
      notices_.follow(one, sent[one].incarnation, 0);
      take({.kind = Notice::Kind::kCame, .process = one});
    }
    if (!is_there) {
      continue;
    }
    // A ring holds fewer; that of a faulty process may never end.
    for (std::size_t i = 0; i < segment::NoticeWords::kWords; ++i) {
      const auto record = notices_.next(one, sent[one].words);
      if (!record) {
        break;
      }
      auto notice = from_record(*record);
      if (notice && is_sent_by_all(notice->kind)) {
        notice->process = one;
        all.emplace(notice->component, std::move(*notice));
      }
    }
  }
  for (const auto& [component, notice] : all) {
    take(notice);
  }
  if (!all.empty() && process_ == ProcessPlan::kMain) {
    put_snapshot();
  }
  return !all.empty();
}

}  // namespace fastcycle::processes
