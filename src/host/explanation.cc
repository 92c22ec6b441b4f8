#include "host/explanation.h"

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <thread>

#include <elf.h>
#include <fmt/format.h>
#include <link.h>
#include <sys/utsname.h>

#include "component/component_core.h"
#include "config/print.h"
#include "fastcycle/version.h"

namespace fastcycle::host {
namespace {

/// The build id among the notes of `size` bytes at `address`, as hexadecimal digits; else empty.
std::string find_build_id(const std::byte* address, std::size_t size) {
  constexpr auto round_up = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
  while (size >= sizeof(ElfW(Nhdr))) {
    ElfW(Nhdr) note;
    std::memcpy(&note, address, sizeof(note));
    const std::size_t before = sizeof(note) + round_up(note.n_namesz);
    const std::size_t whole = before + round_up(note.n_descsz);
    if (whole > size) {
      break;
    }
    if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 &&
        std::memcmp(address + sizeof(note), "GNU", 4) == 0) {
      std::string digits;
      for (const std::byte byte : std::span(address + before, note.n_descsz)) {
        digits += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
      }
      return digits;
    }
    address += whole;
    size -= whole;
  }
  return {};
}

/// Which builds of which libraries this process runs.
void add_builds(std::map<std::string, std::string>& facts) {
  const auto add = [](dl_phdr_info* library, std::size_t, void* into) {
    const std::span headers(library->dlpi_phdr, library->dlpi_phnum);
    for (const ElfW(Phdr) & header : headers) {
      if (header.p_type != PT_NOTE) {
        continue;
      }
      const auto* notes = reinterpret_cast<const std::byte*>(library->dlpi_addr + header.p_vaddr);
      const std::string build_id = find_build_id(notes, header.p_memsz);
      const std::string name = std::filesystem::path(library->dlpi_name).filename().string();
      if (!build_id.empty()) {
        (*static_cast<std::map<std::string, std::string>*>(
            into))["build_id." + (name.empty() ? "program" : name)] = build_id;
      }
    }
    return 0;
  };
  dl_iterate_phdr(add, &facts);
}

}  // namespace

record::Explanation explain(const config::ApplicationDescription& description,
                            const base::Clock& clock, const Components& components) {
  record::Explanation explanation;
  auto& facts = explanation.facts;
  facts["application"] = description.name;
  // Whoever executes the log again finds from here what relative paths lead to.
  std::error_code ignored;
  facts["file"] = description.file.empty()
                      ? std::string()
                      : std::filesystem::absolute(description.file, ignored).string();
  facts["fastcycle"] = FASTCYCLE_VERSION;
  facts["clock"] = clock.is_simulated() ? "simulated" : "live";
  facts["start_ns"] = std::to_string(base::to_ns(clock.now()));
  utsname machine{};
  if (uname(&machine) == 0) {
    facts["host"] = machine.nodename;
    facts["system"] = fmt::format("{} {} {}", machine.sysname, machine.release, machine.machine);
  }
  add_builds(facts);
  facts["cpus"] = std::to_string(std::thread::hardware_concurrency());
  std::size_t number = 0;
  for (const auto& component : components) {
    facts[fmt::format("component.{}", number++)] = component->name;
  }
  explanation.application = config::print(description.effective);
  return explanation;
}

}  // namespace fastcycle::host
