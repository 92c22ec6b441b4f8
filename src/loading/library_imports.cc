#include "loading/library_imports.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <set>
#include <span>
#include <string_view>

#include <elf.h>
#include <fmt/format.h>

#include "loading/elf_file.h"
#include "loading/mapped_file.h"

namespace fastcycle::host {
namespace {

struct Function {
  std::string_view symbol;
  std::string_view name;  ///< As in source code.
};

constexpr std::array kClocks = {
    Function{"_ZNSt6chrono3_V212steady_clock3nowEv", "std::chrono::steady_clock::now"},
    Function{"_ZNSt6chrono3_V212system_clock3nowEv", "std::chrono::system_clock::now"},
    Function{"clock", "clock"},
    Function{"clock_gettime", "clock_gettime"},
    Function{"gettimeofday", "gettimeofday"},
    Function{"time", "time"},
    Function{"timespec_get", "timespec_get"},
};
constexpr std::array kChance = {
    Function{"_ZNSt13random_device9_M_getvalEv", "std::random_device"},
    Function{"arc4random", "arc4random"},
    Function{"drand48", "drand48"},
    Function{"getentropy", "getentropy"},
    Function{"getrandom", "getrandom"},
    Function{"lrand48", "lrand48"},
    Function{"rand", "rand"},
    Function{"random", "random"},
};
constexpr std::array kThreads = {
    Function{"pthread_create", "pthread_create"},
    Function{
        "_ZNSt6thread15_M_start_threadESt10unique_ptrINS_6_StateESt14default_deleteIS1_EEPFvvE",
        "std::thread"},
    Function{"thrd_create", "thrd_create"},
};

struct Kind {
  std::span<const Function> functions;
  std::string_view what;
  std::string_view hint;
};

const std::array kKinds = {
    Kind{kClocks, "reads a clock of the machine", "time comes from context.now()"},
    Kind{kChance, "draws random numbers of the machine",
         "context.random() draws the same ones in every run"},
    Kind{kThreads, "makes threads of its own",
         "context.create_thread() and context.offload() make some that start and end with the run"},
};

/// Those of `kind` that are among `imports`, as "a, b".
std::string named(const Kind& kind, const std::vector<std::string>& imports) {
  std::string names;
  for (const Function& function : kind.functions) {
    if (std::ranges::find(imports, function.symbol) != imports.end()) {
      names += (names.empty() ? "" : ", ") + std::string(function.name);
    }
  }
  return names;
}

}  // namespace

std::vector<std::string> imported_functions(const std::filesystem::path& library) {
  std::vector<std::string> names;
  const MappedFile file(library);
  const auto header = elf_header(file);
  if (!header) {
    return names;
  }
  for (std::uint64_t i = 0; i < header->e_shnum; ++i) {
    const auto symbols = section_at(file, *header, i);
    if (!symbols || symbols->header.sh_type != SHT_DYNSYM) {
      continue;
    }
    const auto strings = section_at(file, *header, symbols->header.sh_link);
    for (std::size_t at = 0; strings && at + sizeof(Elf64_Sym) <= symbols->content.size();
         at += sizeof(Elf64_Sym)) {
      Elf64_Sym symbol;
      std::memcpy(&symbol, symbols->content.data() + at, sizeof symbol);
      if (symbol.st_shndx != SHN_UNDEF || symbol.st_name >= strings->content.size()) {
        continue;
      }
      names.push_back(text_at(*strings, symbol.st_name));
    }
  }
  return names;
}

void warn_of_imports(const config::ApplicationDescription& description,
                     const LibraryLoader& libraries, config::Problems& problems) {
  std::set<std::string> seen;
  for (const config::ComponentDescription& component : description.components) {
    if (!seen.insert(component.library).second) {
      continue;
    }
    const std::vector<std::string> imports =
        imported_functions(libraries.file_of(component.library));
    for (const Kind& kind : kKinds) {
      const std::string names = named(kind, imports);
      if (!names.empty()) {
        config::Problem problem = config::make_error(
            component.place,
            fmt::format("the library \"{}\" {} ({}): such a run may not repeat exactly",
                        component.library, kind.what, names),
            std::string(kind.hint));
        problem.warning = true;
        problems.add(std::move(problem));
      }
    }
  }
}

}  // namespace fastcycle::host
