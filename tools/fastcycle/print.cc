#include "print.h"

#include <string>

#include "base/printable.h"

namespace fastcycle::tool {

void print_text(std::FILE* stream, std::string_view text) {
  const std::string printed = base::printable_lines(text);
  static_cast<void>(std::fwrite(printed.data(), 1, printed.size(), stream));
}

}  // namespace fastcycle::tool
