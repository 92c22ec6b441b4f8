#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "mcap/file.h"
#include "mcap/record_reader.h"
#include "mcap/records.h"

namespace fastcycle::archive {

/// A file from some record on, with a beginning put before it, so that a `RecordReader` can start
/// in its middle.
///
/// @threads  Safe, as the file is, which outlives this.
class Tail final : public mcap::Source {
 public:
  /// @pre  `from <= whole.size()`
  Tail(const mcap::Source& whole, std::uint64_t from, std::vector<std::byte> beginning);

  [[nodiscard]] std::uint64_t size() const override;
  [[nodiscard]] const std::string& name() const override { return whole_.name(); }
  void read(std::uint64_t offset, std::span<std::byte> into) const override;

  /// The position in the whole file of `offset` here.
  [[nodiscard]] std::uint64_t in_whole(std::uint64_t offset) const;

 private:
  const mcap::Source& whole_;
  const std::uint64_t from_;
  const std::vector<std::byte> beginning_;
};

/// Magic and header: what a reader wants before anything else.
[[nodiscard]] std::vector<std::byte> beginning_of_file();

/// Gives out the records of the summary, up to the first that is wrong; nothing if there is none,
/// or its CRC is wrong.
///
/// @errors  `mcap::Error` if the file cannot be read.
void read_summary(const mcap::Source& file, const mcap::ReadLimits& limits,
                  const std::function<void(const mcap::Record&)>& take);

}  // namespace fastcycle::archive
