#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "diagnostics/text_buffer.h"

namespace fastcycle::diagnostics {

/// The program or a shared library, as mapped into memory.
struct LoadedObject {
  std::uintptr_t begin = 0;
  std::uintptr_t end = 0;
  std::uintptr_t bias = 0;  ///< Difference between addresses in memory and in the file.
  std::string path;
  std::string name;      ///< The path's last part.
  std::string build_id;  ///< In hexadecimal digits; empty if it has none.
  bool is_program = false;
};

/// Updates the table of loaded objects, which is needed to name addresses. Earlier tables stay
/// readable until the process ends. Safe, but not for signal handlers.
void note_loaded_objects();

/// The object that contains `address`, as of the last update; null if none. Also for signal
/// handlers.
[[nodiscard]] const LoadedObject* find_object(std::uintptr_t address) noexcept;

/// One call on a stack.
struct Frame {
  std::uintptr_t address = 0;
  bool is_exact = false;  ///< It is the thread's program counter; else a return address.
  const LoadedObject* object = nullptr;
  std::array<char, 160> function{};  ///< Its C++ name, without arguments; empty: unknown.
  std::uint64_t function_offset = 0;
};

/// Resolves the frames' addresses: their objects, and the functions by the symbol tables of the
/// objects' files. Also for signal handlers: it only opens and maps files.
void name_frames(std::span<Frame> frames) noexcept;

/// `Planner::plan+0x12 (libplanner.so+0x4a2f)`
TextBuffer& operator<<(TextBuffer& text, const Frame& frame) noexcept;

/// Demangles the C++ symbol `mangled`, without arguments of functions and templates:
/// `demo::Planner::plan`. Unsupported parts are omitted at the end. Async-signal-safe, unlike the
/// demangler of the C++ library.
void demangle(std::string_view mangled, TextBuffer& text) noexcept;

}  // namespace fastcycle::diagnostics
