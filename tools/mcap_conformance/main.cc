// mcap_conformance: what the public conformance suite of MCAP asks a reader and a writer to do.

#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>

#include "conformance.h"
#include "mcap/file.h"

namespace {

using namespace std::string_view_literals;

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kWrongCommandLine = 2;

constexpr const char* kUsage =
    "usage: mcap_conformance read FILE.mcap    print the records of the file as JSON\n"
    "       mcap_conformance write FILE.json   write the file that the JSON describes to standard\n"
    "                                          output\n"
    "Exit codes: 0 done, 1 the file cannot be read or written, 2 the command line is wrong\n";

int print(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), stdout) == bytes.size() &&
      std::fflush(stdout) == 0) {
    return kDone;
  }
  std::perror("mcap_conformance: standard output");
  return kFailed;
}

int read(const std::string& file) {
  const fastcycle::mcap::FileSource source(file);
  return print(fastcycle::conformance::read_records(source).dump(2) + "\n");
}

int write(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (!stream) {
    throw std::runtime_error("cannot be read");
  }
  fastcycle::mcap::MemorySink sink("standard output");
  fastcycle::conformance::write_file(nlohmann::json::parse(text), sink);
  return print(fastcycle::mcap::text_of(sink.bytes()));
}

}  // namespace

int main(int argument_count, char** arguments) {
  const std::string_view command = argument_count == 3 ? arguments[1] : ""sv;
  if (argument_count == 2 && (arguments[1] == "--help"sv || arguments[1] == "-h"sv)) {
    return print(kUsage);
  }
  if (command != "read" && command != "write") {
    std::fputs(kUsage, stderr);
    return kWrongCommandLine;
  }
  try {
    return command == "read" ? read(arguments[2]) : write(arguments[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mcap_conformance: %s: %s\n", arguments[2], error.what());
    return kFailed;
  }
}
