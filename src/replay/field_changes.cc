#include "replay/field_changes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <google/protobuf/message.h>

#include "replay/message_difference.h"

namespace fastcycle::host {

FieldChange& FieldChanges::field_of(const std::string& name) {
  FieldChange& field = fields_[name];
  field.field = name;
  return field;
}

void FieldChanges::add(const google::protobuf::Message& recorded,
                       const google::protobuf::Message& now, const ChangePlace& place) {
  std::set<std::string> changed;
  for_each_difference(recorded, now, [&](const FieldDifference& difference) {
    const std::string name = difference.pattern();
    FieldChange& field = field_of(name);
    const auto where = [&] {
      ChangePlace at = place;
      at.path = difference.path();
      at.recorded = difference.recorded();
      at.now = difference.now();
      return at;
    };
    if (field.values++ == 0) {
      field.first = where();
    }
    if (const std::optional<double> change = difference.change()) {
      const double size = std::abs(*change);
      if (field.numbers++ == 0 || size > field.most) {
        field.most = size;
        field.largest = where();
      }
      field.sum += size;
    }
    if (changed.insert(name).second) {
      ++field.messages;
    }
  });
  if (changed.empty()) {
    FieldChange& field = field_of("(bytes)");
    ++field.messages;
    if (field.values++ == 0) {
      field.first = place;
      field.first.path = field.field;
    }
  }
}

std::vector<FieldChange> FieldChanges::all() const {
  std::vector<FieldChange> all;
  for (const auto& [name, field] : fields_) {
    all.push_back(field);
  }
  std::ranges::sort(all, [](const FieldChange& a, const FieldChange& b) {
    return a.messages != b.messages ? a.messages > b.messages : a.field < b.field;
  });
  return all;
}

}  // namespace fastcycle::host
