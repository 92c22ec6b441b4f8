#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace ads::velodyne {

/// A captured UDP datagram. The payload is valid until the next one is read.
struct Datagram {
  std::int64_t time_ns = 0;  ///< Since 1970.
  std::uint32_t source = 0;  ///< IPv4, 192.168.1.201 being 0xc0a801c9.
  std::uint16_t port = 0;    ///< The destination port.
  std::span<const std::uint8_t> payload;
};

/// Reads the UDP datagrams over IPv4 and Ethernet of a capture file: the classic format of pcap, in
/// either byte order, with microseconds or nanoseconds (draft-ietf-opsawg-pcap, "PCAP Capture File
/// Format").
///
/// @threads  Confined.
class PcapReader {
 public:
  /// @errors  Throws `std::runtime_error`, with file, expected and found, if it cannot be read, is
  ///          not a capture file or was not captured from Ethernet.
  explicit PcapReader(const std::filesystem::path& file);

  /// The next datagram; none at the end. Other traffic, fragments and truncated packets are
  /// skipped, and counted.
  std::optional<Datagram> next();

  [[nodiscard]] std::int64_t others() const { return others_; }
  /// Describes damage at the end of the file, with the place; empty if there is none.
  [[nodiscard]] const std::string& damage() const { return damage_; }

 private:
  [[nodiscard]] std::uint32_t number_32(const std::uint8_t* at) const;
  bool read_record(std::int64_t& time_ns, bool& is_whole);
  [[nodiscard]] std::optional<Datagram> datagram() const;

  std::string name_;
  std::ifstream stream_;
  bool is_swapped_ = false;
  std::int64_t fraction_ns_ = 1000;
  std::uint64_t offset_ = 0;
  std::vector<std::uint8_t> bytes_;  // Of the last record read.
  std::int64_t others_ = 0;
  std::string damage_;
};

}  // namespace ads::velodyne
