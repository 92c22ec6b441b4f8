#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "top/keys.h"
#include "top/model.h"
#include "top/table.h"

namespace fastcycle::tool::top {

enum class Page : std::uint8_t { kComponents, kTopics, kChains, kProcesses };
inline constexpr std::size_t kPages = 4;

/// The pages in their order: the chains have one only if there are any, the processes if there are
/// several.
[[nodiscard]] std::vector<Page> pages_of(const Model& model);

/// The state of the display: all that keys change.
///
/// @threads  Compatible.
struct View {
  /// Separate for each page.
  struct Order {
    std::size_t column = 0;  ///< The column of the table to sort by.
    bool is_reversed = false;
    std::string selected = {};  ///< The row's name; empty: none.
  };

  Page page = Page::kComponents;
  std::array<Order, kPages> orders = {};
  std::string filter = {};
  bool is_typing_filter = false;
  bool is_paused = false;
  bool shows_help = false;
  bool shows_details = false;  ///< Of the selected row.
  int scrolled = 0;            ///< Lines of the help or of the details.
  std::string notice = {};     ///< The last error; empty: none.

  [[nodiscard]] Order& order() { return orders[static_cast<std::size_t>(page)]; }
  [[nodiscard]] const Order& order() const { return orders[static_cast<std::size_t>(page)]; }
};

/// The initial view: components and processes by CPU, topics by rate, chains by breaches.
[[nodiscard]] View first_view();

/// The rows of the view's page as displayed: filtered and sorted.
[[nodiscard]] Table table_of(const Model& model, const View& view);

/// Applies `key` to `view`, on a terminal of this size. Returns false if the key quits.
[[nodiscard]] bool press(View& view, const Key& key, const Model& model, int width, int height);

}  // namespace fastcycle::tool::top
