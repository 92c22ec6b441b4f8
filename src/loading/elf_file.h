#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include <elf.h>

#include "loading/mapped_file.h"

namespace fastcycle::host {

/// A section of an ELF file: its header, and its bytes in the mapped file.
struct Section {
  Elf64_Shdr header;
  std::string_view content;
};

/// Section `index`; none if it does not exist or has no bytes in the file.
inline std::optional<Section> section_at(const MappedFile& file, const Elf64_Ehdr& header,
                                         std::uint64_t index) {
  if (index >= header.e_shnum) {
    return std::nullopt;
  }
  const auto section = file.read<Elf64_Shdr>(header.e_shoff + index * header.e_shentsize);
  if (!section || section->sh_type == SHT_NOBITS) {
    return std::nullopt;
  }
  const auto content = file.at(section->sh_offset, section->sh_size);
  if (!content) {
    return std::nullopt;
  }
  return Section{*section, *content};
}

/// None if the file is not a 64-bit ELF file.
inline std::optional<Elf64_Ehdr> elf_header(const MappedFile& file) {
  const auto header = file.read<Elf64_Ehdr>(0);
  const bool is_one = header && std::memcmp(header->e_ident, ELFMAG, SELFMAG) == 0 &&
                      header->e_ident[EI_CLASS] == ELFCLASS64;
  return is_one ? header : std::nullopt;
}

/// The text that begins at `at`.
inline std::string text_at(const Section& strings, std::uint64_t at) {
  if (at >= strings.content.size()) {
    return {};
  }
  const std::string_view rest = strings.content.substr(at);
  return std::string(rest.substr(0, rest.find('\0')));
}

}  // namespace fastcycle::host
