#include "loading/component_library.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
#include <string_view>

#include <dlfcn.h>
#include <elf.h>
#include <sys/stat.h>

#include "base/floating_point.h"
#include "config/nearest.h"
#include "loading/mapped_file.h"

namespace fastcycle::host {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEntry = "fastcycle_component_library_v1";

constexpr std::uint64_t round_up_to_4(std::uint64_t size) {
  return (size + 3) / 4 * 4;
}

/// The text of the note named "FastCycle" in the notes from `offset` on.
std::optional<std::string> find_note(const MappedFile& file, std::uint64_t offset,
                                     std::uint64_t size) {
  const std::uint64_t end = offset + size;
  while (offset < end) {
    const auto header = file.read<Elf64_Nhdr>(offset);
    if (!header) {
      return std::nullopt;
    }
    const std::uint64_t name_offset = offset + sizeof(Elf64_Nhdr);
    const std::uint64_t text_offset = name_offset + round_up_to_4(header->n_namesz);
    const auto name = file.at(name_offset, header->n_namesz);
    const auto text = file.at(text_offset, header->n_descsz);
    if (!name || !text) {
      return std::nullopt;
    }
    if (name->substr(0, name->find('\0')) == "FastCycle") {
      return std::string(text->substr(0, text->find('\0')));
    }
    offset = text_offset + round_up_to_4(header->n_descsz);
  }
  return std::nullopt;
}

// ELF header values of a library for this machine.
#if defined(__x86_64__)
constexpr Elf64_Half kMachine = EM_X86_64;
#elif defined(__aarch64__)
constexpr Elf64_Half kMachine = EM_AARCH64;
#else
constexpr Elf64_Half kMachine = EM_NONE;  // Unknown: the loader decides.
#endif
constexpr unsigned char kByteOrder =
    std::endian::native == std::endian::little ? ELFDATA2LSB : ELFDATA2MSB;

/// Why a loaded library offers no classes; empty if it does.
std::string find_wrong(const ComponentLibrary* library) {
  if (library == nullptr) {
    return std::string("offers nothing: its ") + kEntry + " returns null";
  }
  if (library->interface_version != kInterfaceVersion) {
    return "has the interface version " + std::to_string(library->interface_version) + ", not " +
           std::to_string(kInterfaceVersion);
  }
  return library->class_count == 0 ? "offers no class" : "";
}

/// "sanitizer" of the first word in which the two differ, with both values.
std::string first_difference(std::string_view expected, std::string_view found) {
  const auto next_word = [](std::string_view& text) {
    const auto end = text.find(' ');
    const std::string_view word = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    return word;
  };
  while (!expected.empty() || !found.empty()) {
    const std::string_view a = next_word(expected);
    const std::string_view b = next_word(found);
    if (a != b) {
      return std::string(a) + " here, " + std::string(b) + " there";
    }
  }
  return {};
}

/// Current identity of the file; all zeros if it does not exist.
LibraryFile look_at_file(const fs::path& path) {
  struct stat status{};
  if (stat(path.c_str(), &status) != 0) {
    return {};
  }
  return {
      .device = status.st_dev,
      .inode = status.st_ino,
      .size = static_cast<std::uint64_t>(status.st_size),
      .modified_ns = std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec};
}

/// Adds the names of the libraries in `folder`, each prefixed with `prefix`.
void add_names(const fs::path& folder, const std::string& prefix, std::vector<std::string>& names) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string file = entry->path().filename().string();
    if (file.size() > 6 && file.starts_with("lib") && file.ends_with(".so")) {
      names.push_back(prefix + file.substr(3, file.size() - 6));
    }
  }
}

/// "a, b"; for many, the first ones and a count.
std::string list_of(const std::vector<fs::path>& folders) {
  constexpr std::size_t kMaxShown = 16;
  std::string list;
  for (std::size_t i = 0; i < std::min(folders.size(), kMaxShown); ++i) {
    list += (list.empty() ? "" : ", ") + folders[i].string();
  }
  if (folders.size() > kMaxShown) {
    list += " and " + std::to_string(folders.size() - kMaxShown) + " more";
  }
  return list;
}

}  // namespace

fs::path core_library_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&core_library_folder), &info) == 0 ||
      info.dli_fname == nullptr) {
    return {};
  }
  std::error_code ignored;
  return fs::weakly_canonical(info.dli_fname, ignored).parent_path();
}

fs::path helper_program(const std::string& name) {
  return (core_library_folder() / FASTCYCLE_HELPERS / name).lexically_normal();
}

std::vector<fs::path> library_folders(const config::ApplicationDescription& description,
                                      const std::vector<fs::path>& from_command_line) {
  std::vector<fs::path> folders = from_command_line;
  folders.insert(folders.end(), description.library_path.begin(), description.library_path.end());
  const fs::path beside = description.file.parent_path();
  folders.push_back(beside.empty() ? fs::path(".") : beside);
  folders.push_back(beside / "build");  // Beside the source file of a project.
  folders.push_back(core_library_folder() / "fastcycle");
  return folders;
}

fs::path library_file(const std::string& name) {
  const fs::path path(name);
  return path.parent_path() / ("lib" + path.filename().string() + ".so");
}

BuildNote read_build_note(const fs::path& path) {
  const MappedFile file(path);
  if (!file.error.empty()) {
    return {{}, file.error};
  }
  const auto header = file.read<Elf64_Ehdr>(0);
  if (!header || std::memcmp(header->e_ident, ELFMAG, SELFMAG) != 0) {
    return {{}, "not an ELF file"};
  }
  if (header->e_ident[EI_CLASS] != ELFCLASS64 || header->e_type != ET_DYN) {
    return {{}, "not a 64-bit shared library"};
  }
  if (header->e_ident[EI_DATA] != kByteOrder ||
      (kMachine != EM_NONE && header->e_machine != kMachine)) {
    return {{}, "built for another processor"};
  }
  std::optional<std::string> text;
  for (unsigned i = 0; i < header->e_phnum; ++i) {
    const auto program =
        file.read<Elf64_Phdr>(header->e_phoff + std::uint64_t{i} * header->e_phentsize);
    if (!program ||
        (program->p_type == PT_LOAD && !file.at(program->p_offset, program->p_filesz))) {
      return {{}, "cut short"};
    }
    if (!text && program->p_type == PT_NOTE && program->p_filesz < 1U << 20) {
      text = find_note(file, program->p_offset, program->p_filesz);
    }
  }
  return {std::move(text), {}};
}

std::string host_build_note() {
  return FASTCYCLE_BUILD_NOTE;
}

bool has_right_note(const std::string& name, const fs::path& file, const config::Place& place,
                    config::Problems& problems) {
  const std::string library = "library \"" + name + "\"";
  const BuildNote note = read_build_note(file);
  if (!note.error.empty()) {
    problems.add(config::make_error(
        place, library + " cannot be loaded: " + file.string() + ": " + note.error));
    return false;
  }
  if (!note.text) {
    problems.add(config::make_error(
        place, library + " is no component library: " + file.string() + " has no FastCycle note",
        "is FASTCYCLE_COMPONENT(YourClass) at the end of one of its sources?"));
    return false;
  }
  if (*note.text != host_build_note()) {
    config::Problem problem;
    problem.place = place;
    problem.expected = host_build_note();
    problem.found = *note.text;
    problem.message = library + " was built for another FastCycle: " +
                      first_difference(host_build_note(), *note.text) + " (" + file.string() + ")";
    problem.hint = "build it again against the FastCycle that runs it";
    problems.add(std::move(problem));
    return false;
  }
  return true;
}

const ComponentLibrary* library_in(void* handle, const std::string& name, const fs::path& file,
                                   const config::Place& place, config::Problems& problems) {
  const std::string library = "library \"" + name + "\"";
  using Entry = const ComponentLibrary* (*)();
  const auto entry = reinterpret_cast<Entry>(dlsym(handle, kEntry));
  if (entry == nullptr) {
    problems.add(config::make_error(
        place, library + " has no function " + kEntry + " (" + file.string() + ")",
        "is FASTCYCLE_COMPONENT(YourClass) in one of its sources?"));
    return nullptr;
  }
  const ComponentLibrary* classes = entry();
  if (const std::string wrong = find_wrong(classes); !wrong.empty()) {
    problems.add(config::make_error(place, library + " " + wrong + " (" + file.string() + ")"));
    return nullptr;
  }
  return classes;
}

const ComponentClass* class_of(const ComponentLibrary& library,
                               const config::ComponentDescription& component,
                               config::Problems& problems) {
  const std::span classes(library.classes, library.class_count);
  if (component.class_name.empty() && classes.size() == 1) {
    return &classes.front();
  }
  std::vector<std::string> names;
  for (const ComponentClass& candidate : classes) {
    if (component.class_name == candidate.name) {
      return &candidate;
    }
    names.emplace_back(candidate.name);
  }
  std::string all;
  for (const std::string& name : names) {
    all += (all.empty() ? "\"" : ", \"") + name + "\"";
  }
  if (component.class_name.empty()) {
    problems.add(config::make_error(component.place, "library \"" + component.library +
                                                         "\" has several "
                                                         "classes: say \"class\": one of " +
                                                         all));
  } else {
    problems.add(
        config::make_error(component.place,
                           "library \"" + component.library + "\" has no class \"" +
                               component.class_name + "\", only " + all,
                           config::did_you_mean(config::nearest(component.class_name, names))));
  }
  return nullptr;
}

LibraryLoader::LibraryLoader(std::vector<fs::path> folders,
                             const std::optional<config::LibrariesDescription>& pins)
    : folders_(std::move(folders)) {
  if (pins) {
    pinned_.emplace(*pins);
  }
}

fs::path LibraryLoader::file_of(const std::string& name) const {
  for (const fs::path& folder : folders_) {
    std::error_code ignored;
    const fs::path file = folder / library_file(name);
    if (fs::exists(fs::symlink_status(file, ignored))) {
      return fs::absolute(file, ignored);
    }
  }
  return {};
}

const std::vector<std::string>& LibraryLoader::known_names() {
  if (known_names_) {
    return *known_names_;
  }
  std::vector<std::string>& names = known_names_.emplace();
  for (const fs::path& folder : folders_) {
    add_names(folder, "", names);
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      std::error_code ignored;
      if (entry->is_directory(ignored)) {
        add_names(entry->path(), entry->path().filename().string() + "/", names);
      }
    }
  }
  return names;
}

std::string LibraryLoader::nearest_to(const std::string& name) {
  const std::vector<std::string>& names = known_names();
  const auto is_meant = [&](const std::string& known) { return known.ends_with("/" + name); };
  const auto in_folder = std::ranges::find_if(names, is_meant);
  return in_folder != names.end() ? *in_folder : config::nearest(name, names);
}

const ComponentLibrary* LibraryLoader::open(const std::string& name, const config::Place& place,
                                            config::Problems& problems) {
  const auto known = open_.find(name);
  if (known != open_.end()) {
    return known->second;
  }
  const ComponentLibrary* library = load(name, place, problems);
  open_[name] = library;
  return library;
}

const ComponentLibrary* LibraryLoader::load(const std::string& name, const config::Place& place,
                                            config::Problems& problems) {
  if (name.empty()) {
    return nullptr;  // Already reported when the application was read.
  }
  const fs::path file = file_of(name);
  const std::string library = "library \"" + name + "\"";
  if (file.empty()) {
    const std::string hint =
        problems.keeps_errors() ? config::did_you_mean(nearest_to(name)) : std::string();
    problems.add(config::make_error(
        place,
        library + " was not found: no " + library_file(name).string() + " in " + list_of(folders_),
        hint));
    return nullptr;
  }
  // Before reading any of it: a file replaced after this point is a different file.
  files_[name] = look_at_file(file);
  if (const auto tried = expected_.find(name);
      tried != expected_.end() && tried->second != files_[name]) {
    problems.add(config::make_error(
        place,
        library + " was exchanged or written since it was tried, a moment ago: " + file.string(),
        "start again when nothing writes it any more, such as a build"));
    return nullptr;
  }
  if (!has_right_note(name, file, place, problems)) {
    return nullptr;
  }
  void* handle = pinned_ ? pinned_->open(name, file, problems)
                         : dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  base::reset_floating_point();
  if (handle == nullptr && pinned_) {
    return nullptr;
  }
  if (handle == nullptr) {
    problems.add(config::make_error(place, library + " cannot be loaded: " + dlerror()));
    return nullptr;
  }
  return library_in(handle, name, file, place, problems);
}

const ComponentClass* LibraryLoader::find(const config::ComponentDescription& component,
                                          config::Problems& problems) {
  const ComponentClass* its_class = choose(component, problems);
  if (its_class != nullptr && its_class->overrides_serve && !component.serve_period) {
    config::Problem problem = config::make_error(
        component.place,
        "component \"" + component.name + "\": serve() of its class " + its_class->name +
            " is never called, because the component has no \"serve_period_ms\"",
        "say how often it is called, or remove serve() from the class");
    problem.warning = true;
    problems.add(std::move(problem));
  }
  return its_class;
}

const ComponentClass* LibraryLoader::choose(const config::ComponentDescription& component,
                                            config::Problems& problems) {
  const ComponentLibrary* library = open(component.library, component.place, problems);
  if (library == nullptr) {
    return nullptr;
  }
  return class_of(*library, component, problems);
}

}  // namespace fastcycle::host
