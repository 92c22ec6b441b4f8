#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/priority_mutex.h"
#include "config/params.h"
#include "config/problem.h"
#include "fastcycle/params.h"

namespace fastcycle::host {

/// Guards what is committed, of all components.
using ParamMutex = base::PriorityMutex;

/// Where a parameter has its value from.
enum class ParamOrigin : std::uint8_t { kFallback, kOwn, kShared, kChanged };

/// One parameter of a component.
struct DeclaredParam {
  std::unique_ptr<detail::ParamSlot> slot;
  detail::ParamData committed;  ///< What the last transaction made of it.
  ParamOrigin origin = ParamOrigin::kFallback;
  config::Place place;      ///< Where its value stands, if a file or an option gave it.
  bool is_declared = true;  ///< By the component's present object.

  [[nodiscard]] const detail::ParamSpec& spec() const { return slot->spec; }
};

/// New values for parameters of one component.
using ParamValues = std::vector<std::pair<detail::ParamSlot*, detail::ParamData>>;

/// The parameters of one component: owns what is committed, which any thread may look at and
/// change, and what is in place, which only the component's own activations see and change.
///
/// @threads  As said of each part.
class ParamTable {
 public:
  explicit ParamTable(ParamMutex& mutex) : mutex_(mutex) {}

  // Where the component is constructed; take the mutex.

  /// Before the constructor. One that is made anew gets what is committed now, as a whole. Returns
  /// whether that is more than the component's activations have taken over.
  [[nodiscard]] bool begin();
  /// What the present object began with, for a log: a JSON array of the number of the last
  /// transaction, and an object of all values by name.
  [[nodiscard]] std::string begun_with() const;
  /// What is said of the value of a declared parameter.
  struct Given {
    bool is_shared = false;
    bool is_ordered = false;  ///< It counts for an object that is made anew, too.
  };
  [[nodiscard]] detail::ParamSlot& declare(std::unique_ptr<detail::ParamSlot> fresh,
                                           const config::Value* value, Given given,
                                           config::Problems& problems);
  /// Null if `slot` belongs to another component.
  [[nodiscard]] detail::ParamSlot* find(const detail::ParamSlot& slot);
  void add_check(ParamCheck check) { checks_of_object_.push_back(std::move(check)); }
  /// After a constructor that returned.
  void end();

  /// What was committed of one parameter.
  struct Kept {
    detail::ParamSlot* slot;
    detail::ParamData committed;
    ParamOrigin origin;
    config::Place place;
  };
  /// Of those that `params` names, also where the present object does not declare them.
  [[nodiscard]] std::vector<Kept> keep(const config::Value& params) const;
  /// The same again, for the next object. What was not there has its fallback.
  void put_back(const config::Value& params, const std::vector<Kept>& kept);

  // In the component's activations; no mutex.

  /// Puts the values of a transaction in place, unless the object was made with them. Then, if
  /// `tells`, calls back who waits for their change.
  void take_over(std::uint64_t transaction, const ParamValues& values, bool tells);

  // While the mutex is held.

  [[nodiscard]] const std::vector<DeclaredParam>& all() const { return params_; }
  [[nodiscard]] std::vector<DeclaredParam>& all() { return params_; }
  /// Why the component cannot go on with `values`, in one or more sentences.
  [[nodiscard]] std::vector<std::string> objections(const ParamValues& values) const;
  /// @pre  `values` were checked.
  void commit(std::uint64_t transaction, const ParamValues& values);
  /// Number of the last transaction.
  [[nodiscard]] std::uint64_t committed() const { return committed_; }

 private:
  ParamMutex& mutex_;
  std::vector<DeclaredParam> params_;
  std::vector<ParamCheck> checks_;
  std::uint64_t committed_ = 0;  ///< Number of the last transaction.

  // The component's own.
  std::uint64_t in_place_ = 0;                 ///< The same, of what its callbacks see.
  std::vector<detail::ParamData> for_object_;  ///< What an object that is made anew begins with.
  std::vector<bool> is_declared_again_;
  std::vector<ParamCheck> checks_of_object_;
};

}  // namespace fastcycle::host
