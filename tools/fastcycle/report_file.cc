#include "report_file.h"

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <unistd.h>

#include "base/output_file.h"

namespace fastcycle::tool {
namespace {

bool write_all(int file, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = ::write(file, text.data() + done, text.size() - done);
    if (count < 0 && errno != EINTR) {
      return false;
    }
    done += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  return true;
}

}  // namespace

std::string ReportFile::find_obstacle() const {
  return path_.empty() ? std::string() : base::OutputFile::find_obstacle(path_, inputs_);
}

std::string ReportFile::write(const std::string& text) const {
  if (path_.empty()) {
    return {};
  }
  try {
    base::OutputFile file(path_, inputs_);
    if (!write_all(file.descriptor(), text)) {
      return std::strerror(errno);
    }
    file.close();
    file.commit();
    return {};
  } catch (const std::runtime_error& error) {
    return std::string(error.what()).substr(path_.string().size() + 2);  // Without the path.
  }
}

}  // namespace fastcycle::tool
