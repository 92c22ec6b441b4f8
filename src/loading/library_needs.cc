#include "loading/library_needs.h"

#include <cstring>
#include <sstream>

#include "loading/elf_file.h"

namespace fastcycle::host {

LibraryNeeds needs_of(const std::filesystem::path& library) {
  LibraryNeeds needs;
  const MappedFile file(library);
  const auto header = elf_header(file);
  for (std::uint64_t i = 0; header && i < header->e_shnum; ++i) {
    const auto dynamic = section_at(file, *header, i);
    if (!dynamic || dynamic->header.sh_type != SHT_DYNAMIC) {
      continue;
    }
    const auto strings = section_at(file, *header, dynamic->header.sh_link);
    for (std::size_t at = 0; strings && at + sizeof(Elf64_Dyn) <= dynamic->content.size();
         at += sizeof(Elf64_Dyn)) {
      Elf64_Dyn entry;
      std::memcpy(&entry, dynamic->content.data() + at, sizeof entry);
      if (entry.d_tag == DT_NEEDED) {
        needs.names.push_back(text_at(*strings, entry.d_un.d_val));
      } else if (entry.d_tag == DT_RUNPATH || entry.d_tag == DT_RPATH) {
        std::istringstream folders(text_at(*strings, entry.d_un.d_val));
        for (std::string folder; std::getline(folders, folder, ':');) {
          needs.folders.push_back(folder);
        }
      }
    }
  }
  return needs;
}

}  // namespace fastcycle::host
