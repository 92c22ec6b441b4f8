#include "base/build_id.h"

#include <cstdint>
#include <cstring>
#include <span>

#include <elf.h>
#include <fmt/format.h>
#include <link.h>

namespace fastcycle::base {
namespace {

std::span<const ElfW(Phdr)> headers_of(const dl_phdr_info& object) {
  return {object.dlpi_phdr, object.dlpi_phnum};
}

std::string build_id_of(const dl_phdr_info& object) {
  for (const ElfW(Phdr) & header : headers_of(object)) {
    if (header.p_type != PT_NOTE) {
      continue;
    }
    const auto* notes = reinterpret_cast<const std::byte*>(object.dlpi_addr + header.p_vaddr);
    if (std::string id = find_build_id(notes, header.p_memsz); !id.empty()) {
      return id;
    }
  }
  return {};
}

bool contains(const dl_phdr_info& object, std::uintptr_t address) {
  for (const ElfW(Phdr) & header : headers_of(object)) {
    const std::uintptr_t begin = object.dlpi_addr + header.p_vaddr;
    if (header.p_type == PT_LOAD && address >= begin && address - begin < header.p_memsz) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::string find_build_id(const std::byte* notes, std::size_t size) {
  constexpr auto round_up = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
  while (size >= sizeof(ElfW(Nhdr))) {
    ElfW(Nhdr) note;
    std::memcpy(&note, notes, sizeof(note));
    const std::size_t before = sizeof(note) + round_up(note.n_namesz);
    const std::size_t whole = before + round_up(note.n_descsz);
    if (whole > size) {
      break;
    }
    if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 &&
        std::memcmp(notes + sizeof(note), "GNU", 4) == 0) {
      std::string digits;
      for (const std::byte byte : std::span(notes + before, note.n_descsz)) {
        digits += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
      }
      return digits;
    }
    notes += whole;
    size -= whole;
  }
  return {};
}

std::string build_id_at(const void* address) {
  struct Wanted {
    std::uintptr_t address;
    std::string build_id;
  } wanted{reinterpret_cast<std::uintptr_t>(address), {}};
  const auto look = [](dl_phdr_info* object, std::size_t, void* into) {
    auto& its = *static_cast<Wanted*>(into);
    if (!contains(*object, its.address)) {
      return 0;
    }
    its.build_id = build_id_of(*object);
    return 1;
  };
  dl_iterate_phdr(look, &wanted);
  return wanted.build_id;
}

void for_each_build_id(
    const std::function<void(const std::string& file, const std::string& build_id)>& take) {
  const auto look = [](dl_phdr_info* object, std::size_t, void* with) {
    if (const std::string id = build_id_of(*object); !id.empty()) {
      (*static_cast<const std::function<void(const std::string&, const std::string&)>*>(with))(
          object->dlpi_name, id);
    }
    return 0;
  };
  dl_iterate_phdr(look, const_cast<void*>(static_cast<const void*>(&take)));
}

}  // namespace fastcycle::base
