#pragma once

#include <fastcycle/library.h>

/// The build note alone, without what FASTCYCLE_COMPONENT adds to it.
#define BROKEN_NOTE(note_text)                                                           \
  __attribute__((                                                                        \
      section(".note.fastcycle"), used,                                                  \
      aligned(4))) static const ::fastcycle::detail::LibraryNote broken_library_note = { \
      .text = note_text};
