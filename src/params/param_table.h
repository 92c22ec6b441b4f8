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

/// Guards the committed values of all components.
using ParamMutex = base::PriorityMutex;

/// Source of a parameter's value.
enum class ParamOrigin : std::uint8_t { kFallback, kOwn, kShared, kChanged };

/// One parameter of a component.
struct DeclaredParam {
  std::unique_ptr<detail::ParamSlot> slot;
  detail::ParamData committed;  ///< Value as of the last transaction.
  ParamOrigin origin = ParamOrigin::kFallback;
  config::Place place;      ///< Where its value is set, if a file or an option sets it.
  bool is_declared = true;  ///< By the component's present object.

  [[nodiscard]] const detail::ParamSpec& spec() const { return slot->spec; }
};

/// New values for parameters of one component.
using ParamValues = std::vector<std::pair<detail::ParamSlot*, detail::ParamData>>;

/// The parameters of one component: owns the committed values, which any thread may read and
/// change, and the values in place, which only the component's own activations read and change.
///
/// @threads  As stated for each part.
class ParamTable {
 public:
  explicit ParamTable(ParamMutex& mutex) : mutex_(mutex) {}

  // During construction of the component; lock the mutex.

  /// Before the constructor. A re-created component gets all values committed by now. Returns
  /// whether these are newer than what its activations have taken over.
  [[nodiscard]] bool begin();
  /// Initial values of the present object, for a log: a JSON array of the number of the last
  /// transaction, and an object of all values by name.
  [[nodiscard]] std::string begun_with() const;
  /// The value given for a declared parameter.
  struct Given {
    bool is_shared = false;
    bool is_ordered = false;  ///< It also applies to a re-created object.
  };
  [[nodiscard]] detail::ParamSlot& declare(std::unique_ptr<detail::ParamSlot> fresh,
                                           const config::Value* value, Given given,
                                           config::Problems& problems);
  /// Null if `slot` belongs to another component.
  [[nodiscard]] detail::ParamSlot* find(const detail::ParamSlot& slot);
  void add_check(ParamCheck check) { checks_of_object_.push_back(std::move(check)); }
  /// After a constructor that returned.
  void end();

  /// Committed value of one parameter.
  struct Kept {
    detail::ParamSlot* slot;
    detail::ParamData committed;
    ParamOrigin origin;
    config::Place place;
  };
  /// The values of those that `params` names, including undeclared ones.
  [[nodiscard]] std::vector<Kept> keep(const config::Value& params) const;
  /// Restores them for the next object. Missing ones get their fallback.
  void put_back(const config::Value& params, const std::vector<Kept>& kept);

  // In the component's activations; without the mutex.

  /// Puts the values of a transaction in place, unless the object was constructed with them. Then,
  /// if `notifies`, calls the callbacks for their change.
  void take_over(std::uint64_t transaction, const ParamValues& values, bool notifies);

  // With the mutex held.

  [[nodiscard]] const std::vector<DeclaredParam>& all() const { return params_; }
  [[nodiscard]] std::vector<DeclaredParam>& all() { return params_; }
  /// Why the component rejects `values`, in one or more sentences.
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

  // Used only by the component's worker.
  std::uint64_t in_place_ = 0;                 ///< Last transaction that its callbacks see.
  std::vector<detail::ParamData> for_object_;  ///< Initial values for a re-created object.
  std::vector<bool> is_declared_again_;
  std::vector<ParamCheck> checks_of_object_;
};

}  // namespace fastcycle::host
