#include "params/param_table.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <typeinfo>

#include <nlohmann/json.hpp>

#include "params/param_value.h"

namespace fastcycle::host {

using detail::ParamData;
using detail::ParamSlot;

bool ParamTable::begin() {
  const std::lock_guard lock(mutex_);
  const bool is_more = committed_ > in_place_;
  in_place_ = committed_;
  for_object_.clear();
  for (const DeclaredParam& param : params_) {
    for_object_.push_back(param.committed);
  }
  is_declared_again_.assign(params_.size(), false);
  checks_of_object_.clear();
  return is_more;
}

std::string ParamTable::begun_with() const {
  nlohmann::ordered_json values = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < for_object_.size(); ++i) {
    if (!params_[i].spec().is_tunable) {
      continue;
    }
    values[params_[i].spec().name] = to_json(params_[i].spec(), for_object_[i]);
  }
  return nlohmann::ordered_json{in_place_, std::move(values)}.dump(
      -1, ' ', false, nlohmann::json::error_handler_t::replace);
}

ParamSlot& ParamTable::declare(std::unique_ptr<ParamSlot> fresh, const config::Value* value,
                               Given given, config::Problems& problems) {
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < is_declared_again_.size(); ++i) {
    ParamSlot& slot = *params_[i].slot;
    const ParamSlot& declared = *fresh;
    if (!is_declared_again_[i] && slot.spec.name == declared.spec.name &&
        typeid(slot) == typeid(declared)) {
      is_declared_again_[i] = true;
      slot.renew(*fresh);
      if (given.is_ordered && value != nullptr) {
        if (auto data = read_param(slot.spec, *value, problems)) {
          params_[i].committed = for_object_[i] = std::move(*data);
          params_[i].origin = ParamOrigin::kOwn;
          params_[i].place = value->place();
        }
      }
      slot.put(for_object_[i]);
      return slot;
    }
  }
  DeclaredParam param;
  param.slot = std::move(fresh);
  auto data = value != nullptr ? read_param(param.spec(), *value, problems) : std::nullopt;
  param.committed = data ? std::move(*data) : fallback_of(param.spec());
  if (value != nullptr) {
    param.origin = given.is_shared ? ParamOrigin::kShared : ParamOrigin::kOwn;
    param.place = value->place();
  }
  param.slot->put(param.committed);
  params_.push_back(std::move(param));
  return *params_.back().slot;
}

ParamSlot* ParamTable::find(const ParamSlot& slot) {
  const auto found =
      std::ranges::find_if(params_, [&](const auto& param) { return param.slot.get() == &slot; });
  return found == params_.end() ? nullptr : found->slot.get();
}

void ParamTable::end() {
  const std::lock_guard lock(mutex_);
  // Values that the present object does not declare are unused.
  for (std::size_t i = 0; i < is_declared_again_.size(); ++i) {
    params_[i].is_declared = is_declared_again_[i];
  }
  checks_ = std::move(checks_of_object_);
  checks_of_object_.clear();
  for_object_.clear();
}

std::vector<ParamTable::Kept> ParamTable::keep(const config::Value& params) const {
  std::vector<Kept> kept;
  const std::lock_guard lock(mutex_);
  for (const DeclaredParam& param : params_) {
    if (params.find_dotted(param.spec().name) != nullptr) {
      kept.push_back({.slot = param.slot.get(),
                      .committed = param.committed,
                      .origin = param.origin,
                      .place = param.place});
    }
  }
  return kept;
}

void ParamTable::put_back(const config::Value& params, const std::vector<Kept>& kept) {
  const std::lock_guard lock(mutex_);
  for (DeclaredParam& param : params_) {
    if (params.find_dotted(param.spec().name) == nullptr) {
      continue;
    }
    const auto before = std::ranges::find(kept, param.slot.get(), &Kept::slot);
    const bool was_there = before != kept.end();
    param.committed = was_there ? before->committed : fallback_of(param.spec());
    param.origin = was_there ? before->origin : ParamOrigin::kFallback;
    param.place = was_there ? before->place : config::Place();
  }
}

void ParamTable::take_over(std::uint64_t transaction, const ParamValues& values, bool notifies) {
  if (transaction <= in_place_) {
    return;
  }
  in_place_ = transaction;
  for (const auto& [slot, data] : values) {
    slot->put(data);
  }
  for (const auto& [slot, data] : values) {
    if (!notifies || !slot->on_change) {
      continue;
    }
    const std::string what = "its callback for a change of \"" + slot->spec.name + "\" threw: ";
    try {
      slot->on_change();
    } catch (const std::exception& exception) {
      throw std::runtime_error(what + exception.what());
    } catch (...) {
      throw std::runtime_error(what + "something that is no std::exception");
    }
  }
}

std::vector<std::string> ParamTable::objections(const ParamValues& values) const {
  const ProposedParams proposed([&](const ParamSlot& slot) -> const ParamData& {
    for (const auto& [changed, data] : values) {
      if (changed == &slot) {
        return data;
      }
    }
    for (const DeclaredParam& param : params_) {
      if (param.slot.get() == &slot) {
        return param.committed;
      }
    }
    throw std::logic_error("it asks for a parameter of another component");
  });
  std::vector<std::string> sentences;
  for (const ParamCheck& check : checks_) {
    std::string sentence;
    try {
      sentence = check(proposed);
    } catch (const std::exception& exception) {
      sentence = std::string("its check of the parameters threw: ") + exception.what();
    } catch (...) {
      sentence = "its check of the parameters threw";
    }
    if (!sentence.empty()) {
      sentences.push_back(std::move(sentence));
    }
  }
  return sentences;
}

void ParamTable::commit(std::uint64_t transaction, const ParamValues& values) {
  committed_ = transaction;
  for (const auto& [slot, data] : values) {
    for (DeclaredParam& param : params_) {
      if (param.slot.get() == slot) {
        param.committed = data;
      }
    }
  }
}

}  // namespace fastcycle::host
