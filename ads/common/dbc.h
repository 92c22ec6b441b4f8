#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ads {

/// One signal of a CAN message: its bits, and their meaning.
///
/// @threads  Compatible.
struct DbcSignal {
  std::string name;
  std::size_t start_bit = 0;  ///< As in the file: bit `start_bit % 8` of byte `start_bit / 8`.
  std::size_t bit_count = 0;
  bool is_big_endian = false;  ///< Motorola: `start_bit` is the most significant bit. Else Intel.
  bool is_signed = false;
  double factor = 1.0;
  double offset = 0.0;
  std::string unit;

  /// How many bytes a payload must have to hold this signal.
  [[nodiscard]] std::size_t byte_count() const;

  /// The physical value, in `unit`.
  ///
  /// @pre  `payload.size() >= byte_count()`
  [[nodiscard]] double decode(std::span<const std::uint8_t> payload) const;

  /// Writes the nearest representable value to `value`, in `unit`, and leaves all other bits
  /// unchanged. A value outside the signal's range is clamped.
  ///
  /// @pre  `payload.size() >= byte_count()`, `value` is no NaN and `factor` is not 0.
  void encode(double value, std::span<std::uint8_t> payload) const;
};

/// One message of a CAN bus.
struct DbcMessage {
  std::uint32_t address = 0;  ///< The identifier; without the flag that marks 29 bit ones.
  bool is_extended = false;
  std::string name;
  std::string place;  ///< The file and line of its definition.
  std::size_t byte_count = 0;
  std::vector<DbcSignal> signals;

  /// The signal of that name.
  ///
  /// @errors  Throws `std::runtime_error` if there is none, or if it does not fit into the message.
  [[nodiscard]] const DbcSignal& signal(std::string_view name) const;
};

/// The messages of a CAN bus, as described by a file in Vector's DBC format: its `BO_` and `SG_`
/// lines. Multiplexing is not evaluated, and other lines are ignored.
///
/// @threads  Compatible.
class Dbc {
 public:
  /// @errors  Throws `std::runtime_error` with file, line, what was expected and what was found.
  static Dbc read(const std::filesystem::path& file);
  /// Reads the `text` of a file; `name` is used in error messages.
  static Dbc parse(std::string_view text, std::string_view name);

  /// The message of that name.
  ///
  /// @errors  Throws `std::runtime_error` if there is none.
  [[nodiscard]] const DbcMessage& message(std::string_view name) const;

  [[nodiscard]] const std::vector<DbcMessage>& messages() const { return messages_; }

 private:
  explicit Dbc(std::string_view name) : name_(name) {}

  std::string name_;
  std::vector<DbcMessage> messages_;
};

/// The factor that converts a value in `unit`, as DBC files write it, to SI units (m, m/s, rad): 1
/// / 3.6 for "km/h".
///
/// @errors  Throws `std::runtime_error` for an unknown unit.
double si_per_unit(std::string_view unit);

}  // namespace ads
