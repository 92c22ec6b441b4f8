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

enum class Page : std::uint8_t { kComponents, kTopics, kChains };
inline constexpr std::size_t kPages = 3;

/// How many of the pages there are: that of the chains only where there is one.
[[nodiscard]] std::size_t pages_of(const Model& model);

/// What the person at the terminal wants to see: all that keys change.
///
/// @threads  Compatible.
struct View {
  /// Of each page on its own.
  struct Order {
    std::size_t column = 0;  ///< Of the table's headings; what it is sorted by.
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
  std::string notice = {};     ///< What went wrong meanwhile; empty: nothing.

  [[nodiscard]] Order& order() { return orders[static_cast<std::size_t>(page)]; }
  [[nodiscard]] const Order& order() const { return orders[static_cast<std::size_t>(page)]; }
};

/// What is shown first: components by CPU, topics by rate, chains by breaches.
[[nodiscard]] View first_view();

/// The rows of the view's page as they are shown: filtered and sorted.
[[nodiscard]] Table table_of(const Model& model, const View& view);

/// Changes `view` as the key says, on a terminal of this size. False: the key says that it is over.
[[nodiscard]] bool press(View& view, const Key& key, const Model& model, int width, int height);

}  // namespace fastcycle::tool::top
