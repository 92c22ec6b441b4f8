#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ads {

/// One signal of a CAN message: where its bits are, and what they mean.
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

  /// Writes the bits that come closest to `value`, in `unit`, and leaves all others as they are.
  /// What the bits cannot hold becomes the nearest value that they can.
  ///
  /// @pre  `payload.size() >= byte_count()`, `value` is no NaN and `factor` is not 0.
  void encode(double value, std::span<std::uint8_t> payload) const;
};

/// One message of a CAN bus.
struct DbcMessage {
  std::uint32_t address = 0;  ///< The identifier; without the flag that marks 29 bit ones.
  bool is_extended = false;
  std::string name;
  std::string place;  ///< The file and line where it stands.
  std::size_t byte_count = 0;
  std::vector<DbcSignal> signals;

  /// The signal of that name.
  ///
  /// @errors  Throws `std::runtime_error` if there is none, or if it does not fit into the message.
  [[nodiscard]] const DbcSignal& signal(std::string_view name) const;
};

/// The messages of a CAN bus, as a file in Vector's DBC format describes them: its `BO_` and `SG_`
/// lines. Whether a signal is multiplexed is not looked at, and other lines are passed over.
///
/// @threads  Compatible.
class Dbc {
 public:
  /// @errors  Throws `std::runtime_error` with file, line, what was expected and what was found.
  static Dbc read(const std::filesystem::path& file);
  /// Reads the `text` of a file; `name` stands in the messages of what is thrown.
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

/// What a value in `unit`, as DBC files write it, is multiplied by to be in SI units (m, m/s, rad):
/// 1 / 3.6 for "km/h".
///
/// @errors  Throws `std::runtime_error` for a unit that it does not know.
double si_per_unit(std::string_view unit);

}  // namespace ads
