#include "diagnostics/loaded_objects.h"

#include <atomic>
#include <cstring>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include <fcntl.h>
#include <link.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fastcycle::diagnostics {
namespace {

using Objects = std::vector<LoadedObject>;

// Read by signal handlers; older tables are kept.
std::atomic<const Objects*> g_objects{nullptr};

std::string build_id_of(const dl_phdr_info& info) {
  for (int i = 0; i < info.dlpi_phnum; ++i) {
    const ElfW(Phdr)& part = info.dlpi_phdr[i];
    if (part.p_type != PT_NOTE) {
      continue;
    }
    const char* at = reinterpret_cast<const char*>(info.dlpi_addr + part.p_vaddr);
    const char* const end = at + part.p_memsz;
    while (at + sizeof(ElfW(Nhdr)) <= end) {
      ElfW(Nhdr) note;
      std::memcpy(&note, at, sizeof(note));
      const char* const name = at + sizeof(note);
      const char* const text = name + (note.n_namesz + 3) / 4 * 4;
      if (text + note.n_descsz > end) {
        break;
      }
      if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 &&
          std::memcmp(name, "GNU", 4) == 0) {
        std::string digits;
        for (unsigned byte = 0; byte < note.n_descsz; ++byte) {
          const auto value = static_cast<unsigned char>(text[byte]);
          digits += "0123456789abcdef"[value / 16];
          digits += "0123456789abcdef"[value % 16];
        }
        return digits;
      }
      at = text + (note.n_descsz + 3) / 4 * 4;
    }
  }
  return {};
}

std::string path_of_program() {
  std::array<char, 4096> path{};
  const ssize_t size = readlink("/proc/self/exe", path.data(), path.size());
  return size <= 0 ? "the program" : std::string(path.data(), static_cast<std::size_t>(size));
}

int add_object(dl_phdr_info* info, std::size_t, void* data) {
  auto& objects = *static_cast<Objects*>(data);
  LoadedObject object;
  object.bias = info->dlpi_addr;
  object.begin = UINTPTR_MAX;
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const ElfW(Phdr)& part = info->dlpi_phdr[i];
    if (part.p_type == PT_LOAD) {
      object.begin =
          std::min(object.begin, static_cast<std::uintptr_t>(info->dlpi_addr + part.p_vaddr));
      object.end = std::max(
          object.end, static_cast<std::uintptr_t>(info->dlpi_addr + part.p_vaddr + part.p_memsz));
    }
  }
  if (object.begin >= object.end) {
    return 0;
  }
  const bool is_program = info->dlpi_name == nullptr || info->dlpi_name[0] == '\0';
  object.is_program = is_program;
  object.path = is_program ? path_of_program() : info->dlpi_name;
  object.name = object.path.substr(object.path.rfind('/') + 1);
  object.build_id = build_id_of(*info);
  objects.push_back(std::move(object));
  return 0;
}

/// An object's file, mapped to be read. Everything in it is checked before it is believed.
class MappedElf {
 public:
  explicit MappedElf(const char* path) noexcept {
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat status{};
    if (file >= 0 && fstat(file, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0) {
      const auto size = static_cast<std::size_t>(status.st_size);
      void* const memory = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
      if (memory != MAP_FAILED) {
        bytes_ = {static_cast<const char*>(memory), size};
      }
    }
    if (file >= 0) {
      close(file);
    }
  }
  MappedElf(const MappedElf&) = delete;
  MappedElf& operator=(const MappedElf&) = delete;
  ~MappedElf() {
    if (!bytes_.empty()) {
      munmap(const_cast<char*>(bytes_.data()), bytes_.size());
    }
  }

  struct Symbols {
    const ElfW(Sym) * symbols = nullptr;
    std::size_t count = 0;
    std::string_view names;
  };

  /// All symbols, or else those that others may use.
  [[nodiscard]] Symbols symbols() const noexcept {
    const auto* const head = at<ElfW(Ehdr)>(0);
    if (head == nullptr || std::memcmp(head->e_ident, ELFMAG, SELFMAG) != 0 ||
        head->e_shentsize != sizeof(ElfW(Shdr))) {
      return {};
    }
    Symbols found;
    for (unsigned i = 0; i < head->e_shnum; ++i) {
      const auto* const section = at<ElfW(Shdr)>(head->e_shoff + i * sizeof(ElfW(Shdr)));
      if (section == nullptr) {
        break;
      }
      const bool is_all = section->sh_type == SHT_SYMTAB;
      if (!is_all && (section->sh_type != SHT_DYNSYM || found.symbols != nullptr)) {
        continue;
      }
      const auto* const names =
          at<ElfW(Shdr)>(head->e_shoff + section->sh_link * sizeof(ElfW(Shdr)));
      if (names == nullptr || !has(names->sh_offset, names->sh_size) ||
          !has(section->sh_offset, section->sh_size) ||
          section->sh_offset % alignof(ElfW(Sym)) != 0) {
        continue;
      }
      found = {.symbols = reinterpret_cast<const ElfW(Sym)*>(bytes_.data() + section->sh_offset),
               .count = section->sh_size / sizeof(ElfW(Sym)),
               .names = bytes_.substr(names->sh_offset, names->sh_size)};
      if (is_all) {
        break;
      }
    }
    return found;
  }

 private:
  [[nodiscard]] bool has(std::uint64_t offset, std::uint64_t size) const noexcept {
    return offset <= bytes_.size() && size <= bytes_.size() - offset;
  }
  template <typename T>
  [[nodiscard]] const T* at(std::uint64_t offset) const noexcept {
    return offset % alignof(T) == 0 && has(offset, sizeof(T))
               ? reinterpret_cast<const T*>(bytes_.data() + offset)
               : nullptr;
  }

  std::string_view bytes_;
};

/// The address in the object's file for the look-up of the function: a return address is behind its
/// call.
std::uint64_t file_address(const Frame& frame) noexcept {
  return frame.address - frame.object->bias - (frame.is_exact ? 0 : 1);
}

void name_frames_of(const LoadedObject& object, std::span<Frame> frames) noexcept {
  const MappedElf file(object.path.c_str());
  const MappedElf::Symbols symbols = file.symbols();
  for (std::size_t i = 0; i < symbols.count; ++i) {
    const ElfW(Sym)& symbol = symbols.symbols[i];
    if (ELF64_ST_TYPE(symbol.st_info) != STT_FUNC || symbol.st_shndx == SHN_UNDEF ||
        symbol.st_name >= symbols.names.size()) {
      continue;
    }
    for (Frame& frame : frames) {
      if (frame.object != &object || frame.function[0] != '\0') {
        continue;
      }
      const std::uint64_t address = file_address(frame);
      if (address < symbol.st_value ||
          address - symbol.st_value >= std::max<std::uint64_t>(symbol.st_size, 1)) {
        continue;
      }
      const std::string_view rest = symbols.names.substr(symbol.st_name);
      TextBuffer name(std::span(frame.function).first(frame.function.size() - 1));
      demangle(rest.substr(0, rest.find('\0')), name);
      frame.function_offset = frame.address - object.bias - symbol.st_value;
    }
  }
}

// ---- Symbols of C++ ----

bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}

/// Reads as much of a symbol as a name needs.
class Demangler {
 public:
  Demangler(std::string_view mangled, TextBuffer& text) noexcept : rest_(mangled), text_(text) {}

  void run() noexcept {
    while (take('Z')) {  // Within a function: that is named first.
    }
    skip('L');
    if (take('N')) {
      while (take('r') || take('V') || take('K') || take('R') || take('O')) {
      }
      while (!rest_.empty() && rest_.front() != 'E' && read_part()) {
      }
    } else if (rest_.starts_with("St")) {
      read_part();
      read_part();
    } else {
      read_part();
    }
    if (rest_.find("Ul") != std::string_view::npos) {
      text_ << "::{lambda}";
    }
  }

 private:
  [[nodiscard]] bool take(char c) noexcept {
    const bool is_there = !rest_.empty() && rest_.front() == c;
    rest_.remove_prefix(is_there ? 1 : 0);
    return is_there;
  }
  void skip(char c) noexcept { static_cast<void>(take(c)); }

  void append(std::string_view part) noexcept {
    text_ << (has_part_ ? "::" : "") << part;
    has_part_ = true;
  }

  std::string_view read_source_name() noexcept {
    std::size_t size = 0;
    while (!rest_.empty() && is_digit(rest_.front()) && size < 100'000) {
      size = size * 10 + static_cast<std::size_t>(rest_.front() - '0');
      rest_.remove_prefix(1);
    }
    const std::string_view name = rest_.substr(0, size);
    rest_.remove_prefix(name.size());
    return name;
  }

  /// One part of a name; false if it is none that is known here.
  bool read_part() noexcept {
    skip('L');
    if (rest_.empty()) {
      return false;
    }
    if (is_digit(rest_.front())) {
      last_ = read_source_name();
      append(last_.starts_with("_GLOBAL__N_") ? "(anonymous)" : last_);
      return true;
    }
    if (rest_.starts_with("St")) {
      rest_.remove_prefix(2);
      append("std");
      return true;
    }
    if (rest_.front() == 'S' && rest_.size() > 1) {
      const char which = rest_[1];
      append(which == 's' ? "std::string" : which == 'a' ? "std::allocator" : "…");
      const std::size_t end = is_digit(which) || which == '_' || (which >= 'A' && which <= 'Z')
                                  ? rest_.find('_') + 1
                                  : 2;
      rest_.remove_prefix(std::min(std::max<std::size_t>(end, 1), rest_.size()));
      return true;
    }
    if (rest_.front() == 'I') {
      return skip_arguments();
    }
    const bool has_digit = rest_.size() > 1 && is_digit(rest_[1]);
    if (has_digit && (rest_.front() == 'C' || rest_.front() == 'D')) {
      append(rest_.front() == 'C' ? "" : "~");
      text_ << last_;
      rest_.remove_prefix(2);
      return true;
    }
    if (rest_.starts_with("cl")) {
      append("operator()");
    } else if (!rest_.starts_with("Ul") && rest_.front() >= 'a' && rest_.front() <= 'z') {
      append("operator");
    }
    return false;
  }

  /// `I…E`, with all that is nested in it.
  bool skip_arguments() noexcept {
    for (int depth = 0; !rest_.empty();) {
      const char c = rest_.front();
      if (is_digit(c)) {
        static_cast<void>(read_source_name());
        continue;
      }
      if ((c == 'S' || c == 'T') && rest_.size() > 1) {
        const char next = rest_[1];
        const bool is_numbered = next == '_' || is_digit(next) || (next >= 'A' && next <= 'Z');
        const std::size_t end = is_numbered ? rest_.find('_') : 1;
        rest_.remove_prefix(std::min(end == std::string_view::npos ? 1 : end + 1, rest_.size()));
        continue;
      }
      rest_.remove_prefix(1);
      if (c == 'D' && !rest_.empty()) {
        depth += rest_.front() == 't' || rest_.front() == 'T' ? 1 : 0;
        rest_.remove_prefix(1);
        continue;
      }
      if (c == 'L') {  // A literal: its type, its digits, E.
        const std::size_t end = rest_.find('E');
        rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
        continue;
      }
      depth += c == 'I' || c == 'N' || c == 'X' || c == 'F' || c == 'J' ? 1 : c == 'E' ? -1 : 0;
      if (depth == 0) {
        return true;
      }
    }
    return false;
  }

  std::string_view rest_;
  TextBuffer& text_;
  std::string_view last_;
  bool has_part_ = false;
};

}  // namespace

void note_loaded_objects() {
  static std::mutex mutex;
  static auto& tables = *new std::deque<std::unique_ptr<const Objects>>;
  auto objects = std::make_unique<Objects>();
  const std::lock_guard lock(mutex);
  dl_iterate_phdr(&add_object, objects.get());
  const Objects* const known = g_objects.load(std::memory_order_acquire);
  const auto is_same = [](const LoadedObject& a, const LoadedObject& b) {
    return a.begin == b.begin && a.path == b.path;
  };
  if (known != nullptr && std::ranges::equal(*known, *objects, is_same)) {
    return;
  }
  g_objects.store(objects.get(), std::memory_order_release);
  tables.push_back(std::move(objects));
}

const LoadedObject* find_object(std::uintptr_t address) noexcept {
  const Objects* const objects = g_objects.load(std::memory_order_acquire);
  if (objects == nullptr) {
    return nullptr;
  }
  for (const LoadedObject& object : *objects) {
    if (object.begin <= address && address < object.end) {
      return &object;
    }
  }
  return nullptr;
}

void name_frames(std::span<Frame> frames) noexcept {
  for (Frame& frame : frames) {
    frame.object = find_object(frame.address);
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const LoadedObject* const object = frames[i].object;
    const auto before = frames.first(i);
    const bool is_new =
        std::ranges::none_of(before, [&](const Frame& frame) { return frame.object == object; });
    if (object != nullptr && is_new) {
      name_frames_of(*object, frames);
    }
  }
}

TextBuffer& operator<<(TextBuffer& text, const Frame& frame) noexcept {
  if (frame.object == nullptr) {
    return text << Hex{frame.address};
  }
  if (frame.function[0] != '\0') {
    text << frame.function.data() << "+" << Hex{frame.function_offset} << " ";
  }
  return text << "(" << frame.object->name << "+" << Hex{frame.address - frame.object->bias} << ")";
}

void demangle(std::string_view mangled, TextBuffer& text) noexcept {
  if (!mangled.starts_with("_Z")) {
    text << mangled;
    return;
  }
  Demangler(mangled.substr(2), text).run();
}

}  // namespace fastcycle::diagnostics
