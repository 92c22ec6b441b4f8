#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "diagnostics/text_buffer.h"

namespace fastcycle::diagnostics {

/// The program or a shared library, as it lies in memory.
struct LoadedObject {
  std::uintptr_t begin = 0;
  std::uintptr_t end = 0;
  std::uintptr_t bias = 0;  ///< An address less this is one of the file.
  std::string path;
  std::string name;      ///< The path's last part.
  std::string build_id;  ///< In hexadecimal digits; empty if it has none.
  bool is_program = false;
};

/// Looks again which objects are loaded; before something was loaded nobody can name its addresses.
/// Tables of before stay readable as long as the process lives. Safe, for no signal handler.
void note_loaded_objects();

/// Which object has `address`, as of the last look; null if none has. Also for signal handlers.
[[nodiscard]] const LoadedObject* find_object(std::uintptr_t address) noexcept;

/// One call on a stack.
struct Frame {
  std::uintptr_t address = 0;
  bool is_exact = false;  ///< It is where the thread stands; else where a call returns to.
  const LoadedObject* object = nullptr;
  std::array<char, 160> function{};  ///< Its name as C++ has it, without arguments; empty: unknown.
  std::uint64_t function_offset = 0;
};

/// Finds out what the frames' addresses are: their objects, and the functions by the symbol tables
/// of the objects' files. Also for signal handlers: it opens and maps files, and does no more.
void name_frames(std::span<Frame> frames) noexcept;

/// `Planner::plan+0x12 (libplanner.so+0x4a2f)`
TextBuffer& operator<<(TextBuffer& text, const Frame& frame) noexcept;

/// Writes what the C++ symbol `mangled` stands for, without arguments of functions and templates:
/// `demo::Planner::plan`. What is not understood is left out at the end. For signal handlers, which
/// the demangler of the C++ library is not.
void demangle(std::string_view mangled, TextBuffer& text) noexcept;

}  // namespace fastcycle::diagnostics
