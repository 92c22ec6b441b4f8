// fastcycle new: creates a separate project that builds against the installed FastCycle, and
// extends it.

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <dlfcn.h>
#include <nlohmann/json.hpp>

#include "command.h"
#include "fastcycle/version.h"
#include "new/edits.h"
#include "new/templates.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;

using Words = std::map<std::string, std::string>;  ///< The text for each %placeholder%.

/// An error message for the user. Nothing was written.
class Refusal : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

constexpr std::array kCppKeywords = {
    "alignas",       "alignof",     "and",        "and_eq",    "asm",       "auto",
    "bitand",        "bitor",       "bool",       "break",     "case",      "catch",
    "char",          "class",       "co_await",   "co_return", "co_yield",  "compl",
    "concept",       "const",       "const_cast", "consteval", "constexpr", "constinit",
    "continue",      "decltype",    "default",    "delete",    "do",        "double",
    "dynamic_cast",  "else",        "enum",       "explicit",  "export",    "extern",
    "false",         "float",       "for",        "friend",    "goto",      "if",
    "inline",        "int",         "long",       "mutable",   "namespace", "new",
    "noexcept",      "not",         "not_eq",     "nullptr",   "operator",  "or",
    "or_eq",         "private",     "protected",  "public",    "register",  "reinterpret_cast",
    "requires",      "return",      "short",      "signed",    "sizeof",    "static",
    "static_assert", "static_cast", "struct",     "switch",    "template",  "this",
    "thread_local",  "throw",       "true",       "try",       "typedef",   "typeid",
    "typename",      "union",       "unsigned",   "using",     "virtual",   "void",
    "volatile",      "while",       "xor",        "xor_eq"};

/// Names that CMake, the compiler, C++ or FastCycle have for something else; a target `m` would be
/// linked in the place of libm.
constexpr std::array kTakenNames = {
    "all",        "build",    "c",          "clean",     "component", "components",
    "depend",     "dl",       "edit_cache", "fastcycle", "google",    "gtest",
    "gtest_main", "help",     "i386",       "install",   "linux",     "m",
    "main",       "messages", "package",    "protobuf",  "pthread",   "rebuild_cache",
    "rt",         "std",      "test",       "testing",   "unix",      "z"};

/// A name becomes a file, a target of CMake, a namespace of C++ and a package of protobuf.
void check_name(const std::string& name) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
  };
  if (name.empty() || name.size() > 40 || name.front() < 'a' || name.front() > 'z' ||
      !std::ranges::all_of(name, is_allowed)) {
    throw Refusal(
        "expected a name of at most 40 small letters, digits and _, such as speed_limiter, found "
        "\"" +
        name + "\"");
  }
  if (std::ranges::find(kCppKeywords, name) != kCppKeywords.end()) {
    throw Refusal("\"" + name + "\" is a keyword of C++; choose another name");
  }
  if (std::ranges::find(kTakenNames, name) != kTakenNames.end() || name.ends_with("_t")) {
    throw Refusal("\"" + name + "\" is already used; choose another name");
  }
  if (dlsym(RTLD_DEFAULT, name.c_str()) != nullptr) {
    throw Refusal("\"" + name +
                  "\" is a function of the C library, and cannot name anything else in C++; "
                  "choose another name");
  }
}

/// "SpeedLimiter" of "speed_limiter".
std::string class_name(const std::string& name) {
  std::string result;
  bool is_first = true;
  for (const char c : name) {
    if (c != '_') {
      result += is_first ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    }
    is_first = c == '_';
  }
  return result;
}

std::string filled(std::string text, const Words& words) {
  for (const auto& [word, value] : words) {
    const std::string placeholder = "%" + word + "%";
    for (std::size_t at = text.find(placeholder); at != std::string::npos;
         at = text.find(placeholder, at + value.size())) {
      text.replace(at, placeholder.size(), value);
    }
  }
  return text;
}

std::string read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Temporary files next to their targets, which stay unchanged until all are written. Unfinished
/// ones are removed.
class Unfinished {
 public:
  Unfinished() = default;
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;
  ~Unfinished() {
    std::error_code ignored;
    for (const auto& [beside, path] : files_) {
      fs::remove(beside, ignored);
    }
    for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder) {
      fs::remove(*folder, ignored);
    }
  }

  void write(const fs::path& path, const std::string& text) {
    make_folder(path.parent_path());
    fs::path beside = path;
    beside += ".unfinished";
    files_.emplace_back(beside, path);
    errno = 0;
    std::ofstream file(beside, std::ios::binary);
    file << text;
    file.close();
    if (!file) {
      throw std::runtime_error(path.string() + ": cannot be written: " +
                               std::system_category().message(errno) + "; nothing was changed");
    }
    if (fs::exists(path)) {
      fs::permissions(beside, fs::status(path).permissions());
    }
  }

  void finish() {
    for (const auto& [beside, path] : files_) {
      fs::rename(beside, path);
    }
    files_.clear();
    folders_.clear();
  }

 private:
  void make_folder(const fs::path& folder) {
    if (!folder.empty() && !fs::exists(folder)) {
      make_folder(folder.parent_path());
      fs::create_directory(folder);
      folders_.push_back(folder);
    }
  }

  std::vector<std::pair<fs::path, fs::path>> files_;
  std::vector<fs::path> folders_;
};

/// New files and changed ones: all of them, or none where one cannot be.
class Changes {
 public:
  void add(const fs::path& path, std::string text) {
    if (fs::exists(fs::symlink_status(path))) {
      throw Refusal(path.string() + " exists already; nothing was written");
    }
    files_.emplace_back(path, std::move(text));
  }
  void add_templates(const std::string& kind, const fs::path& folder, const Words& words) {
    for (const Template& file : templates()) {
      if (file.kind == kind) {
        add(folder / filled(file.path, words), filled(file.text, words));
      }
    }
  }
  void change(const fs::path& path, std::string text) {
    files_.emplace_back(path, std::move(text));
  }

  void write() const {
    Unfinished unfinished;
    for (const auto& [path, text] : files_) {
      unfinished.write(path, text);
    }
    unfinished.finish();
    for (const auto& [path, text] : files_) {
      print_to(stdout, "  {}\n", path.string());
    }
  }

 private:
  std::vector<std::pair<fs::path, std::string>> files_;
};

/// The project in the working folder.
struct Project {
  std::string cmake;
  std::string name;
};

Project project_here() {
  Project project{.cmake = read("CMakeLists.txt"), .name = {}};
  if (project.cmake.find("find_package(FastCycle") == std::string::npos) {
    throw Refusal("this folder is not a FastCycle project: " + fs::current_path().string() +
                  " has no CMakeLists.txt with find_package(FastCycle); `fastcycle new app NAME` "
                  "creates one");
  }
  project.name = project_of(project.cmake).value_or("");
  return project;
}

void refuse_target(const Project& project, const std::string& function, const std::string& name) {
  for (const char* const end : {" ", ")", "\n"}) {
    if (project.cmake.find(function + "(NAME " + name + end) != std::string::npos) {
      throw Refusal("CMakeLists.txt already contains " + function + "(NAME " + name + " …)");
    }
  }
}

std::string call_of_messages(const std::string& name) {
  return "fastcycle_messages(NAME " + name + "_messages PROTO_ROOT messages PROTOS " + name +
         "/value.proto)";
}

std::string call_of_component(const std::string& name, const std::string& package) {
  return "fastcycle_component(NAME " + name + " SOURCES components/" + name + ".cc MESSAGES " +
         package + "_messages\n                    TESTS components/" + name + "_test.cc)";
}

/// The commands that configure a project so that cmake finds this FastCycle. An uninstalled build
/// is installed first.
std::string configure_commands() {
  std::error_code error;
  const fs::path prefix = fs::read_symlink("/proc/self/exe", error).parent_path().parent_path();
  if (fs::exists(prefix / "CMakeCache.txt", error)) {
    return "  cmake --install " + prefix.string() +
           " --prefix $HOME/fastcycle\n  cmake -B build -DCMAKE_PREFIX_PATH=$HOME/fastcycle\n";
  }
  const char* const path = std::getenv("PATH");
  const std::string folders = ":" + std::string(path == nullptr ? "" : path) + ":";
  const bool is_found = error || prefix == "/usr" || prefix == "/usr/local" ||
                        folders.find(":" + (prefix / "bin").string() + ":") != std::string::npos;
  return "  cmake -B build" + (is_found ? "" : " -DCMAKE_PREFIX_PATH=" + prefix.string()) + "\n";
}

/// This program, as text in a JSON string.
std::string program_file() {
  std::error_code error;
  const fs::path file = fs::read_symlink("/proc/self/exe", error);
  const std::string text = nlohmann::json(error ? "fastcycle" : file.string())
                               .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return text.substr(1, text.size() - 2);
}

void new_app(const std::string& name) {
  check_name(name);
  if (fs::exists(fs::symlink_status(name))) {
    throw Refusal(name + " exists already; nothing was written");
  }
  Changes changes;
  changes.add_templates("app", name,
                        {{"name", name},
                         {"Class", class_name(name)},
                         {"fastcycle", program_file()},
                         {"version", std::to_string(FASTCYCLE_VERSION_MAJOR) + "." +
                                         std::to_string(FASTCYCLE_VERSION_MINOR)}});
  changes.write();
  print_to(stdout,
           "\nNext:\n  cd {}\n{}  cmake --build build\n  ctest --test-dir build\n"
           "  fastcycle run build/{}.json --for 2s\n",
           name, configure_commands(), name);
}

void new_component(const std::string& name, const std::string& messages) {
  check_name(name);
  const Project project = project_here();
  const std::string package = messages.empty() ? project.name : messages;
  refuse_target(project, "fastcycle_component", name);
  if (!fs::exists("messages/" + package + "/value.proto")) {
    throw Refusal("there is no messages/" + package +
                  "/value.proto, the message type of the new component; --messages NAME selects "
                  "another package");
  }
  Changes changes;
  changes.add_templates("component", "",
                        {{"name", name}, {"Class", class_name(name)}, {"package", package}});
  changes.change("CMakeLists.txt",
                 with_call(project.cmake, "fastcycle_component", call_of_component(name, package),
                           "fastcycle_application"));
  const std::string entry = R"({"name": ")" + name + R"(", "library": ")" + name + R"("})";
  const std::string application = application_of(project.cmake).value_or("");
  const auto changed = with_component(read(application), entry);
  if (changed) {
    changes.change(application, *changed);
  }
  changes.write();
  if (!changed) {
    print_to(
        stdout,
        "\nCMakeLists.txt names no fastcycle_application with \"components\". Add to yours:\n  "
        "{}\n",
        entry);
  }
  print_to(stdout,
           "\n"
           "It subscribes to {}/value and publishes {}/value. Next:\n"
           "  cmake --build build\n"
           "  ctest --test-dir build\n",
           package, name);
  if (changed) {
    print_to(stdout, "  fastcycle run build/{} --for 2s\n",
             fs::path(application).filename().string());
  }
}

void new_messages(const std::string& name) {
  check_name(name);
  const Project project = project_here();
  refuse_target(project, "fastcycle_messages", name + "_messages");
  Changes changes;
  changes.add_templates("messages", "", {{"name", name}});
  changes.change("CMakeLists.txt", with_call(project.cmake, "fastcycle_messages",
                                             call_of_messages(name), "fastcycle_component"));
  changes.write();
  print_to(
      stdout,
      "\n"
      "A component that uses it lists it in CMakeLists.txt, MESSAGES {}_messages, and contains\n"
      "  #include \"{}/value.pb.h\"\n"
      "or is created with it:\n"
      "  fastcycle new component NAME --messages {}\n",
      name, name, name);
}

template <typename Body>
int refusing(const std::string& word, const Body& body) {
  try {
    body();
    return flush_output();
  } catch (const Refusal& refusal) {
    print_to(stderr, "fastcycle new {}: {}\n", word, refusal.what());
    return kWrong;
  }
}

Command add_new_app(CLI::App& group) {
  CLI::App* line = group.add_subcommand("app", "Create a project: a component, messages, a test");
  line->footer(
      examples("  fastcycle new app speed\n"
               "\n"
               "Creates the folder NAME here. It builds against the installed FastCycle.\n"));
  const auto name = std::make_shared<std::string>();
  line->add_option("name", *name, "Its name: lower-case letters, digits, _")
      ->required()
      ->type_name("NAME");
  return {line, [name] { return refusing("app", [&] { new_app(*name); }); }};
}

Command add_new_component(CLI::App& group) {
  CLI::App* line =
      group.add_subcommand("component", "Add a component, with a test, to the project here");
  line->footer(
      examples("  fastcycle new component speed_limiter\n"
               "  fastcycle new component tracker --messages radar\n"
               "\n"
               "Adds its three files, and entries to CMakeLists.txt and the application.\n"));
  const auto name = std::make_shared<std::string>();
  const auto messages = std::make_shared<std::string>();
  line->add_option("name", *name, "Its name: lower-case letters, digits, _")
      ->required()
      ->type_name("NAME");
  line->add_option("--messages", *messages,
                   "The messages that it receives, PACKAGE/value (those of the project)")
      ->type_name("PACKAGE");
  return {line, [name, messages] {
            return refusing("component", [&] { new_component(*name, *messages); });
          }};
}

Command add_new_messages(CLI::App& group) {
  CLI::App* line = group.add_subcommand("messages", "Add a message package to the project here");
  line->footer(examples("  fastcycle new messages radar\n"));
  const auto name = std::make_shared<std::string>();
  line->add_option("name", *name, "Its name: lower-case letters, digits, _")
      ->required()
      ->type_name("NAME");
  return {line, [name] { return refusing("messages", [&] { new_messages(*name); }); }};
}

}  // namespace

Command add_new(CLI::App& program) {
  CLI::App* group = program.add_subcommand("new", "Create a project, or add to it");
  group->require_subcommand(0, 1);
  group->footer(
      examples("  fastcycle new app speed\n"
               "  fastcycle new component speed_limiter\n"
               "  fastcycle new messages radar\n"));
  return {.line = group,
          .words = {add_new_app(*group), add_new_component(*group), add_new_messages(*group)}};
}

}  // namespace fastcycle::tool
