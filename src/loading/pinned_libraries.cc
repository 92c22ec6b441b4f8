#include "loading/pinned_libraries.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/mman.h>
#include <unistd.h>

#include "loading/library_needs.h"

namespace fastcycle::host {

namespace fs = std::filesystem;

namespace {

/// A descriptor that the destructor closes.
class File {
 public:
  explicit File(int descriptor) : descriptor_(descriptor) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (descriptor_ >= 0) {
      ::close(descriptor_);
    }
  }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] int release() { return std::exchange(descriptor_, -1); }

 private:
  int descriptor_;
};

bool write_whole(int file, const char* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t count = ::write(file, bytes, size);
    if (count < 0) {
      return false;
    }
    bytes += count;
    size -= static_cast<std::size_t>(count);
  }
  return true;
}

/// Copies `from` to `to`; with -1 only reads. Returns the SHA-256; empty, with `errno`, on failure.
std::string copy_and_sum(int from, int to) {
  EVP_MD_CTX* const context = EVP_MD_CTX_new();
  EVP_DigestInit_ex(context, EVP_sha256(), nullptr);
  std::array<char, 65536> part{};
  ssize_t count = 0;
  while ((count = ::read(from, part.data(), part.size())) > 0) {
    const auto size = static_cast<std::size_t>(count);
    EVP_DigestUpdate(context, part.data(), size);
    if (to >= 0 && !write_whole(to, part.data(), size)) {
      count = -1;
      break;
    }
  }
  std::array<unsigned char, EVP_MAX_MD_SIZE> sum{};
  unsigned length = 0;
  EVP_DigestFinal_ex(context, sum.data(), &length);
  EVP_MD_CTX_free(context);
  std::string text;
  for (unsigned i = 0; count == 0 && i < length; ++i) {
    text += fmt::format("{:02x}", sum[i]);
  }
  return text;
}

void add_needed(const fs::path& library, std::vector<NeededLibrary>& all) {
  const LibraryNeeds needs = needs_of(library);
  for (const std::string& name : needs.names) {
    if (std::ranges::find(all, name, &NeededLibrary::name) != all.end()) {
      continue;
    }
    for (const std::string& folder : needs.folders) {
      constexpr std::string_view kOrigin = "$ORIGIN";
      if (!folder.starts_with(kOrigin)) {
        continue;
      }
      std::error_code error;
      const fs::path real = fs::canonical(library, error);
      const fs::path file =
          (real.parent_path() / ("." + folder.substr(kOrigin.size())) / name).lexically_normal();
      if (!error && fs::is_regular_file(file, error)) {
        add_needed(file, all);
        all.push_back({.name = name, .file = file});
        break;
      }
    }
  }
}

}  // namespace

std::vector<NeededLibrary> needed_libraries(const fs::path& library) {
  std::vector<NeededLibrary> all;
  add_needed(library, all);
  return all;
}

bool is_library_loaded(const std::string& name) {
  void* const handle = ::dlopen(name.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  if (handle != nullptr) {
    ::dlclose(handle);
  }
  return handle != nullptr;
}

bool seal(int file) {
  constexpr int kAttempts = 20;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (::fcntl(file, F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) == 0) {
      return true;
    }
    if (errno != EBUSY) {
      return false;
    }
  }
  return false;
}

SealedCopy seal_copy(const std::string& name, const fs::path& file) {
  const File original(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  File copy(::memfd_create(name.c_str(), MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (original.descriptor() < 0 || copy.descriptor() < 0 ||
      copy_and_sum(original.descriptor(), copy.descriptor()).empty() || !seal(copy.descriptor()) ||
      ::lseek(copy.descriptor(), 0, SEEK_SET) != 0) {
    return {};
  }
  // Of the copy that will be loaded, not of the data read.
  std::string sum = copy_and_sum(copy.descriptor(), -1);
  return {.file = copy.release(), .sha256 = std::move(sum)};
}

std::string path_of(const SealedCopy& copy) {
  return fmt::format("/proc/self/fd/{}", copy.file);
}

std::string sha256_of(const fs::path& file) {
  const File original(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  return original.descriptor() < 0 ? std::string() : copy_and_sum(original.descriptor(), -1);
}

void* PinnedLibraries::open(const std::string& name, const fs::path& file,
                            config::Problems& problems) const {
  // The loader finds loaded dependencies by name and does not search folders for them.
  for (const NeededLibrary& needed : needed_libraries(file)) {
    if (!is_library_loaded(needed.name) &&
        open_one(needed.name, needed.file, problems) == nullptr) {
      return nullptr;
    }
  }
  return open_one(name, file, problems);
}

void* PinnedLibraries::open_one(const std::string& name, const fs::path& file,
                                config::Problems& problems) const {
  const std::string library = "library \"" + name + "\"";
  const auto pin = pins_.sha256.find(name);
  if (pin == pins_.sha256.end()) {
    problems.add(config::make_error(
        pins_.place, library + " is not among those that may be loaded (" + file.string() + ")",
        "fastcycle check APPLICATION --print-pins prints what \"libraries\" has to say"));
    return nullptr;
  }
  const SealedCopy copy = seal_copy(name, file);
  if (copy.file < 0) {
    problems.add(config::make_error(
        pins_.place, library + " cannot be read: " + file.string() + ": " + std::strerror(errno)));
    return nullptr;
  }
  if (copy.sha256 != pin->second) {
    ::close(copy.file);
    problems.add(config::make_error(
        pins_.place,
        fmt::format("{} has other contents than are pinned ({}): expected SHA-256 {}, found {}",
                    library, file.string(), pin->second, copy.sha256),
        "if it was built again on purpose, pin that"));
    return nullptr;
  }
  // Stays open, so that its path is not reused for another library.
  void* const handle = ::dlopen(path_of(copy).c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (handle == nullptr) {
    problems.add(config::make_error(pins_.place, library + " cannot be loaded: " + ::dlerror()));
  }
  return handle;
}

}  // namespace fastcycle::host
