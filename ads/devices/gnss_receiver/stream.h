#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace ads::gnss_stream {

/// Counts of decoded and discarded data of a stream.
struct StreamCounts {
  std::int64_t sentences = 0;  ///< Of NMEA.
  std::int64_t frames = 0;     ///< Of UBX.
  std::int64_t wrong_checksums = 0;
  std::int64_t bytes_left_out = 0;  ///< Between them, or part of damaged ones.
};

/// Finds the sentences of NMEA 0183 ("$…*hh" and the end of a line) and the frames of UBX (b5 62,
/// class, message, length, content, checksum: u-blox 8 / M8 Receiver description, UBX-13003221) in
/// a byte stream, with any bytes between them and any division into reads.
///
/// @threads  Confined.
class StreamParser {
 public:
  /// Of a sentence, without "$" and checksum: "GPGGA,…".
  using SentenceSink = std::function<void(std::string_view)>;
  using FrameSink = std::function<void(std::uint8_t message_class, std::uint8_t message,
                                       std::span<const std::uint8_t> content)>;

  StreamParser(SentenceSink on_sentence, FrameSink on_frame)
      : on_sentence_(std::move(on_sentence)), on_frame_(std::move(on_frame)) {}

  /// Takes the next bytes and calls the sinks for each item that they complete.
  void take(std::string_view bytes);
  /// Discards incomplete data, for a new stream.
  void reset() { buffer_.clear(); }

  [[nodiscard]] const StreamCounts& counts() const { return counts_; }

 private:
  // How many bytes at the begin of `rest` were consumed; 0: more are needed.
  std::size_t step(std::string_view rest);
  std::size_t take_sentence(std::string_view rest);
  std::size_t take_frame(std::string_view rest);
  std::size_t leave_out(std::size_t bytes);

  SentenceSink on_sentence_;
  FrameSink on_frame_;
  std::string buffer_;
  StreamCounts counts_;
};

/// The sentence for "GPGGA,…", with checksum and end of line.
std::string encode_sentence(std::string_view body);

/// The frame with its header and checksum.
std::string encode_frame(std::uint8_t message_class, std::uint8_t message,
                         std::string_view content);

}  // namespace ads::gnss_stream
