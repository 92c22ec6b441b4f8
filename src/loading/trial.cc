#include "loading/trial.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include <fcntl.h>
#include <google/protobuf/descriptor.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/child.h"
#include "loading/component_library.h"
#include "loading/library_versions.h"
#include "loading/protection.h"

namespace fastcycle::host {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kReportDescriptor = 3;
// Of one text of a problem: a constructor's exception may have any length.
constexpr std::size_t kMaxTextBytes = 4096;
// Of one line of the report; a problem with all its texts is far below, and so is the wiring of a
// thousand components.
constexpr std::size_t kMaxLineBytes = std::size_t{8} * 1024 * 1024;

/// The beginning of a text that is too long, cut between two characters, and how much is missing.
std::string shortened(const std::string& text) {
  if (text.size() <= kMaxTextBytes) {
    return text;
  }
  std::size_t length = kMaxTextBytes;
  while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0U) == 0x80U) {
    --length;
  }
  return text.substr(0, length) + "… (" + std::to_string(text.size() - length) + " bytes more)";
}

json to_json(const config::Problem& problem) {
  return {{"file", problem.place.file},
          {"line", problem.place.line},
          {"pointer", problem.place.pointer},
          {"message", shortened(problem.message)},
          {"expected", shortened(problem.expected)},
          {"found", shortened(problem.found)},
          {"hint", shortened(problem.hint)},
          {"warning", problem.warning}};
}

config::Problem to_problem(const json& value) {
  config::Problem problem;
  problem.place = {value.at("file"), value.at("line"), value.at("pointer")};
  problem.message = value.at("message");
  problem.expected = value.at("expected");
  problem.found = value.at("found");
  problem.hint = value.at("hint");
  problem.warning = value.at("warning");
  return problem;
}

/// The message from the parent to the child, on its standard input.
json to_json(const TrialOptions& options, const std::set<std::string>& without,
             const std::string& wanted_proto) {
  json paths = json::array();
  for (const fs::path& path : options.library_path) {
    paths.push_back(path.string());
  }
  json overlays = json::array();
  for (const fs::path& path : options.load.overlays) {
    overlays.push_back(path.string());
  }
  return {{"file", options.load.file.string()},
          {"text", options.load.text ? json(*options.load.text) : json()},
          {"overlays", overlays},
          {"sets", options.load.sets},
          {"variables", options.load.variables},
          {"isolated", options.load.isolated},
          {"schema", options.load.schema_file.string()},
          {"library_path", paths},
          {"library", options.library ? json{{"name", options.library->name},
                                             {"file", options.library->file.string()},
                                             {"others", options.library->others}}
                                      : json()},
          {"throw_is_error", options.on_throw == ConstructorFault::kError},
          // The child has the same secrets as the parent.
          {"refuses_tracers", is_protected()},
          {"without", without},
          {"wanted_proto", wanted_proto}};
}

/// How one child ended, and its report until then.
struct ChildResult {
  bool is_done = false;
  bool is_unreadable = false;  ///< Its report is malformed.
  std::string ending;          ///< In words, if it is not done: "ended by signal 6 (Aborted)".
  std::string last_kind;       ///< "loading" or "constructing", if that is where it ended.
  std::string last_name;       ///< Of the library or component.
  std::string errors;          ///< The end of its standard error.
  std::string proto_library;   ///< Which library has the wanted .proto.
  std::vector<config::Problem> problems;
  TrialResult trial;
};

/// The child process, with a pipe for its report and one for its standard error. It leads a process
/// group, so that whatever a library starts in it ends with it.
class Child {
 public:
  explicit Child(const std::string& options) {
    int report[2];
    int errors[2];
    // Not an argument: those are limited in size and public.
    const int input = file_of(options);
    if (input < 0) {
      error = errno;
      return;
    }
    if (pipe2(report, O_CLOEXEC) != 0) {
      error = errno;
      close(input);
      return;
    }
    report_ = report[0];
    if (pipe2(errors, O_CLOEXEC) != 0) {
      error = errno;
      close(input);
      close(report[1]);
      return;
    }
    errors_ = errors[0];
    for (const int descriptor : {report_, errors_}) {
      fcntl(descriptor, F_SETFL, O_NONBLOCK);
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, errors[1], STDERR_FILENO);
    posix_spawn_file_actions_adddup2(&actions, report[1], kReportDescriptor);
    // Signals that the host handles itself must have their default action in the child.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    const std::string program = helper_program("fastcycle-trial").string();
    std::string name = "fastcycle-trial";
    char* arguments[] = {name.data(), nullptr};
    error = posix_spawn(&pid_, program.c_str(), &actions, &attributes, arguments, environ);
    if (error != 0) {
      pid_ = -1;
    } else {
      end_ = base::open_child(pid_);
    }
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    close(input);
    close(report[1]);
    close(errors[1]);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    for (const int descriptor : {report_, errors_, end_}) {
      if (descriptor >= 0) {
        close(descriptor);
      }
    }
  }

  [[nodiscard]] bool is_running() const { return pid_ > 0; }

  /// Reads until the child has ended; false if it reported nothing for `limit`. Calls `on_slow`
  /// when it reported nothing for `notice`. Its standard error does not count as a report.
  /// `on_line` gets only a part of a line that is too long, which cannot be parsed.
  bool read(std::chrono::milliseconds limit, std::chrono::milliseconds notice,
            const std::function<void(std::string_view)>& on_line,
            const std::function<void()>& on_slow, std::string& errors) {
    using std::chrono::steady_clock;
    std::string report;
    auto deadline = steady_clock::now() + limit;
    auto notice_at = steady_clock::now() + notice;
    bool is_noticed = notice >= limit;
    pollfd descriptors[] = {{report_, POLLIN, 0}, {errors_, POLLIN, 0}, {end_, POLLIN, 0}};
    bool has_ended = false;
    while (!has_ended) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(
          (is_noticed ? deadline : notice_at) - steady_clock::now());
      constexpr std::int64_t kMost = std::numeric_limits<int>::max();
      const int ready =
          left.count() <= 0
              ? 0
              : poll_child(descriptors, static_cast<int>(std::min(left.count(), kMost)));
      if (ready < 0 && errno == EINTR) {
        continue;
      }
      if (ready == 0 && !is_noticed) {
        is_noticed = true;
        on_slow();
        continue;
      }
      if (ready <= 0) {
        return false;
      }
      has_ended = descriptors[2].revents != 0;
      if (has_ended) {
        kill();
      }
      // At its end the rest of its output is in the pipes, which hold 64 KiB.
      constexpr int kReadsToEmptyAPipe = 32;
      for (int i = 0; i < (has_ended ? kReadsToEmptyAPipe : 1); ++i) {
        append(descriptors[0], report);
        append(descriptors[1], errors);
      }
      for (auto end = report.find('\n'); end != std::string::npos; end = report.find('\n')) {
        on_line(std::string_view(report).substr(0, end));
        report.erase(0, end + 1);
        deadline = steady_clock::now() + limit;
        notice_at = steady_clock::now() + notice;
        is_noticed = notice >= limit;
      }
      if (report.size() > kMaxLineBytes) {
        on_line(report);
        report.clear();
      }
      keep_end(errors, 16 * 1024);
    }
    return true;
  }

  /// Kills the child and the processes it started. Keeps its exit status, if it has ended.
  void kill() const { ::kill(-pid_, SIGKILL); }

  /// How it ended.
  int wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
  }

  int error = 0;

 private:
  /// As `poll`, with the end of the child as the last descriptor.
  int poll_child(pollfd (&descriptors)[3], int limit_ms) const {
    if (end_ >= 0) {
      return poll(descriptors, 3, limit_ms);
    }
    for (int left_ms = limit_ms;; left_ms -= base::kLookAgainMs) {
      const bool has_ended = base::has_ended(pid_);
      const int ready = poll(descriptors, 2, std::min(has_ended ? 0 : left_ms, base::kLookAgainMs));
      descriptors[2].revents = has_ended ? POLLIN : 0;
      if (ready != 0 || has_ended || left_ms <= base::kLookAgainMs) {
        return has_ended ? std::max(ready, 0) + 1 : ready;
      }
    }
  }

  /// An unnamed file that contains `text`, positioned at its beginning; -1 with `errno`.
  static int file_of(const std::string& text) {
    const int file = memfd_create("fastcycle-trial", MFD_CLOEXEC);
    for (std::size_t done = 0; file >= 0 && done < text.size();) {
      const ssize_t count = write(file, text.data() + done, text.size() - done);
      if (count < 0 && errno != EINTR) {
        const int reason = errno;
        close(file);
        errno = reason;
        return -1;
      }
      done += count > 0 ? static_cast<std::size_t>(count) : 0;
    }
    if (file >= 0) {
      lseek(file, 0, SEEK_SET);
    }
    return file;
  }

  /// Appends available data; removes the descriptor from the poll at its end.
  static void append(pollfd& descriptor, std::string& text) {
    if (descriptor.fd < 0) {
      return;
    }
    char buffer[4096];
    const ssize_t count = ::read(descriptor.fd, buffer, sizeof(buffer));
    if (count > 0) {
      text.append(buffer, static_cast<std::size_t>(count));
    } else if (count == 0 || (errno != EINTR && errno != EAGAIN)) {
      descriptor.fd = -1;
    }
  }

  static void keep_end(std::string& text, std::size_t size) {
    if (text.size() > size) {
      text.erase(0, text.size() - size);
    }
  }

  pid_t pid_ = -1;
  int report_ = -1;
  int errors_ = -1;
  int end_ = -1;  ///< Readable once the child has ended.
};

std::string describe_end(int status) {
  if (WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    return "ended the process by signal " + std::to_string(number) + " (" + strsignal(number) + ")";
  }
  return "ended the process with exit code " + std::to_string(WEXITSTATUS(status));
}

std::string in_words(std::chrono::milliseconds time) {
  return time.count() % 1000 == 0 ? std::to_string(time.count() / 1000) + " s"
                                  : std::to_string(time.count()) + " ms";
}

/// Handles one line of the child's report.
void take(const json& said, ChildResult& result) {
  const std::string kind = said.at("kind");
  if (kind == "problem") {
    result.problems.push_back(to_problem(said.at("problem")));
  } else if (kind == "proto") {
    result.proto_library = said.at("name");
  } else if (kind == "file") {
    result.trial.files[said.at("name")] = {.device = said.at("device"),
                                           .inode = said.at("inode"),
                                           .size = said.at("size"),
                                           .modified_ns = said.at("modified_ns")};
  } else if (kind == "wiring") {
    result.trial.wiring = said.at("text");
  } else if (kind == "version") {
    result.trial.sha256 = said.at("sha256");
  } else if (kind == "done") {
    result.is_done = true;
  } else {
    result.last_kind = kind;
    result.last_name = said.at("name");
  }
}

ChildResult run_child(const TrialOptions& options, const std::set<std::string>& without,
                      const std::string& wanted_proto) {
  ChildResult result;
  Child child(
      to_json(options, without, wanted_proto).dump(-1, ' ', false, json::error_handler_t::replace));
  if (!child.is_running()) {
    result.ending = std::string("could not be started: ") + std::strerror(child.error);
    return result;
  }
  const auto report_slow = [&] {
    if (!result.last_name.empty()) {
      options.on_slow((result.last_kind == "loading" ? "library \"" : "component \"") +
                      result.last_name + "\" takes longer than " + in_words(TrialOptions::kNotice) +
                      (result.last_kind == "loading" ? " to load" : " to construct") +
                      ", and may take " + in_words(options.limit));
    }
  };
  const bool is_in_time = child.read(
      options.limit, TrialOptions::kNotice,
      [&](std::string_view line) {
        try {
          take(json::parse(line), result);
        } catch (const json::exception&) {
          result.is_unreadable = true;
        }
      },
      report_slow, result.errors);
  if (!is_in_time) {
    child.kill();
  }
  const int status = child.wait();
  if (!result.is_done) {
    result.ending =
        is_in_time ? describe_end(status) : "did not come back within " + in_words(options.limit);
  }
  return result;
}

/// The .proto that two libraries define, if protobuf's registry aborted because of that.
std::string duplicate_proto(const std::string& errors) {
  constexpr std::string_view kMark = "File already exists in database: ";
  const auto begin = errors.find(kMark);
  if (begin == std::string::npos) {
    return {};
  }
  const auto name = begin + kMark.size();
  return errors.substr(name, errors.find_first_of("\r\n", name) - name);
}

std::string last_line(const std::string& text) {
  const auto end = text.find_last_not_of("\r\n ");
  if (end == std::string::npos) {
    return {};
  }
  const auto line_begin = text.find_last_of('\n', end);
  const auto begin =
      text.find_first_not_of(" \t", line_begin == std::string::npos ? 0 : line_begin + 1);
  return text.substr(begin, end + 1 - begin);
}

config::Place place_of(const config::ApplicationDescription& description,
                       const ChildResult& result) {
  for (const config::ComponentDescription& component : description.components) {
    if (result.last_kind == "loading" ? component.library == result.last_name
                                      : component.name == result.last_name) {
      return component.place;
    }
  }
  return description.place;
}

config::Problem to_problem(const TrialOptions& options, const config::Place& place,
                           const ChildResult& result, std::set<std::string> without) {
  const bool is_loading = result.last_kind == "loading";
  config::Problem problem;
  problem.place = place;
  if (const std::string proto = duplicate_proto(result.errors); is_loading && !proto.empty()) {
    without.insert("library " + result.last_name);
    const std::string other = run_child(options, without, proto).proto_library;
    problem.message = "libraries \"" + (other.empty() ? "?" : other) + "\" and \"" +
                      result.last_name + "\" both contain the messages of " + proto;
    problem.hint = "make a message package of it, fastcycle_messages(NAME … PROTOS " + proto +
                   "), and name that under MESSAGES of both components";
    return problem;
  }
  problem.message = (is_loading ? "library \"" : "component \"") + result.last_name + "\" " +
                    result.ending + (is_loading ? " while loading" : " while it was constructed");
  if (const std::string line = last_line(result.errors); !line.empty()) {
    problem.message += ": " + line;
  }
  return problem;
}

}  // namespace

TrialResult try_application(const TrialOptions& options, config::Problems& problems) {
  config::Problems ignored;
  const config::ApplicationDescription description = config::load(options.load, ignored);
  // One more child for each library and each component that ends one.
  const std::size_t most = 2 * description.components.size() + 1;
  std::set<std::string> without;
  for (std::size_t attempt = 0; attempt < most; ++attempt) {
    const ChildResult result = run_child(options, without, {});
    if (result.is_done) {
      for (const config::Problem& problem : result.problems) {
        problems.add(problem);
      }
      if (result.is_unreadable) {
        problems.add(config::make_error(
            description.place, "the trial of the libraries reported something that cannot be read",
            "does a component write to a file descriptor that is not its own?"));
      }
      return result.trial;
    }
    if (result.last_name.empty()) {
      const std::string line = last_line(result.errors);
      problems.add(config::make_error(
          description.place,
          "the trial of the libraries " + result.ending + (line.empty() ? "" : ": " + line)));
      return {};
    }
    problems.add(to_problem(options, place_of(description, result), result, without));
    without.insert((result.last_kind == "loading" ? "library " : "component ") + result.last_name);
  }
  return {};
}

TrialResult try_library(const TrialOptions& options, config::Problems& problems) {
  const ChildResult result = run_child(options, {}, {});
  const config::Place place{.file = options.library->file.string(), .line = 0, .pointer = {}};
  for (const config::Problem& problem : result.problems) {
    problems.add(problem);
  }
  if (!result.is_done) {
    problems.add(result.last_name.empty()
                     ? config::make_error(place, "the trial of the library " + result.ending)
                     : to_problem(options, place, result, {}));
  }
  return result.trial;
}

namespace {

void send(const json& line) {
  const std::string text = line.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
  // A failed write is ignored: the parent no longer reads.
  [[maybe_unused]] const ssize_t count = write(kReportDescriptor, text.data(), text.size());
}

/// Reports each step to the parent before it is done.
class NarratingClasses final : public ComponentClasses {
 public:
  NarratingClasses(LibraryLoader& loader, std::set<std::string> without, std::string wanted_proto)
      : loader_(loader), without_(std::move(without)), wanted_proto_(std::move(wanted_proto)) {}

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override {
    if (without_.contains("library " + component.library) ||
        without_.contains("component " + component.name)) {
      return nullptr;
    }
    send({{"kind", "loading"}, {"name", component.library}});
    const ComponentClass* found = loader_.find(component, problems);
    if (const auto file = loader_.files().find(component.library); file != loader_.files().end()) {
      send({{"kind", "file"},
            {"name", component.library},
            {"device", file->second.device},
            {"inode", file->second.inode},
            {"size", file->second.size},
            {"modified_ns", file->second.modified_ns}});
    }
    if (!wanted_proto_.empty() &&
        google::protobuf::DescriptorPool::generated_pool()->FindFileByName(wanted_proto_)) {
      send({{"kind", "proto"}, {"name", component.library}});
      wanted_proto_.clear();
    }
    return found;
  }

 private:
  LibraryLoader& loader_;
  const std::set<std::string> without_;
  std::string wanted_proto_;
};

/// One class for all components.
class OneClass final : public ComponentClasses {
 public:
  explicit OneClass(const ComponentLibrary& library) : library_(library) {}

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override {
    return class_of(library_, component, problems);
  }

 private:
  const ComponentLibrary& library_;
};

/// Opens the library under trial, beside those that the application has; null after adding to
/// `problems`.
const ComponentLibrary* open_tried(const json& tried, LibraryLoader& loader,
                                   LibraryVersions& versions, config::Problems& problems) {
  for (const std::string name : tried["others"]) {
    config::Problems ignored;  // They run: the files at their paths may have changed since.
    loader.open(name, {}, ignored);
  }
  const std::string name = tried["name"];
  send({{"kind", "loading"}, {"name", name}});
  const auto [library, sha256] =
      versions.open(name, tried["file"].get<std::string>(), {}, problems);
  send({{"kind", "version"}, {"sha256", sha256}});
  return library;
}

/// The parent's options, read from standard input until its end.
json read_options() {
  std::string text;
  char buffer[4096];
  for (ssize_t count = 1; count > 0;) {
    count = read(STDIN_FILENO, buffer, sizeof(buffer));
    if (count > 0) {
      text.append(buffer, static_cast<std::size_t>(count));
    }
  }
  if (const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC); nothing >= 0) {
    dup2(nothing, STDIN_FILENO);
    close(nothing);
  }
  return json::parse(text, nullptr, false);
}

std::vector<fs::path> to_paths(const json& list) {
  std::vector<fs::path> paths;
  for (const std::string path : list) {
    paths.emplace_back(path);
  }
  return paths;
}

}  // namespace

int run_trial_child(const BuildForTrial& build) {
  const auto obstacle = protect_process();
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const json options = fcntl(kReportDescriptor, F_GETFD) < 0 ? json() : read_options();
  if (!options.is_object() || !options.contains("file")) {
    static_cast<void>(std::fprintf(
        stderr,
        "fastcycle-trial is started by fastcycle itself, to try an application's libraries\n"));
    return 2;
  }
  fcntl(kReportDescriptor, F_SETFD, FD_CLOEXEC);
  if (obstacle && options["refuses_tracers"]) {
    const config::Place place{options["file"].get<std::string>(), 0, ""};
    send({{"kind", "problem"},
          {"problem",
           to_json(config::make_error(place, "the trial of the libraries: " + *obstacle))}});
    send({{"kind", "done"}});
    return 0;
  }
  config::Problems problems;
  const json& text = options["text"];
  const config::LoadOptions load{
      .file = options["file"].get<std::string>(),
      .text = text.is_string() ? std::optional(text.get<std::string>()) : std::nullopt,
      .overlays = to_paths(options["overlays"]),
      .sets = options["sets"],
      .variables = options["variables"],
      .isolated = options["isolated"],
      .schema_file = options["schema"].get<std::string>()};
  config::ApplicationDescription description = config::load(load, problems);
  LibraryLoader loader(library_folders(description, to_paths(options["library_path"])),
                       description.libraries);
  NarratingClasses narrating(loader, options["without"], options["wanted_proto"]);
  LibraryVersions versions(description.libraries);
  std::optional<OneClass> one_class;
  if (const json& tried = options["library"]; tried.is_object()) {
    const ComponentLibrary* const library = open_tried(tried, loader, versions, problems);
    if (library == nullptr) {
      description.components.clear();
    } else {
      one_class.emplace(*library);
      for (config::ComponentDescription& component : description.components) {
        component.library = tried["name"];
      }
    }
  }
  ComponentClasses& classes = one_class ? static_cast<ComponentClasses&>(*one_class) : narrating;
  const BuiltForTrial built = build(
      std::move(description), classes,
      options["throw_is_error"] ? ConstructorFault::kError : ConstructorFault::kFault,
      options["library"].is_object(),
      [](const std::string& component) { send({{"kind", "constructing"}, {"name", component}}); },
      problems);
  for (const config::Problem& problem : problems.all()) {
    send({{"kind", "problem"}, {"problem", to_json(problem)}});
  }
  if (!built.wiring.empty()) {
    send({{"kind", "wiring"}, {"text", built.wiring}});
  }
  send({{"kind", "done"}});
  // No destructors: a trial does not cover them, and they must not end it.
  std::fflush(nullptr);
  _exit(0);
}

}  // namespace fastcycle::host
