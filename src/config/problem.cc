#include "config/problem.h"

#include <map>
#include <set>
#include <utility>

#include "base/printable.h"

namespace fastcycle::config {

std::string to_string(const Problem& problem) {
  std::string result = to_string(problem.place);
  if (!result.empty()) {
    result += ": ";
  }
  if (problem.warning) {
    result += "warning: ";
  }
  result += problem.message;
  if (!problem.hint.empty()) {
    result += "; " + problem.hint;
  }
  return base::printable(result);
}

Problem unexpected(const Value& at, std::string expected, std::string found, std::string hint) {
  Problem problem;
  problem.place = at.place();
  problem.message = "expected " + expected + ", found " + found;
  problem.expected = std::move(expected);
  problem.found = std::move(found);
  problem.hint = std::move(hint);
  return problem;
}

Problem unexpected(const Value& at, std::string expected) {
  return unexpected(at, std::move(expected), shown(at));
}

Problem make_error(Place place, std::string message, std::string hint) {
  Problem problem;
  problem.place = std::move(place);
  problem.message = std::move(message);
  problem.hint = std::move(hint);
  return problem;
}

std::string did_you_mean(std::string_view name) {
  return name.empty() ? std::string() : "did you mean " + in_quotes(name) + "?";
}

void Problems::add(Problem problem) {
  std::size_t& count = problem.warning ? warning_count_ : error_count_;
  if (++count <= kMaxKept) {
    problems_.push_back(std::move(problem));
  }
}

std::vector<Problem> Problems::all() const {
  // Those of one line keep the order in which they were found.
  std::multimap<std::pair<std::string, int>, const Problem*> sorted;
  for (const Problem& problem : problems_) {
    sorted.emplace(std::pair(problem.place.file, problem.place.line), &problem);
  }
  std::set<std::pair<std::string, std::string>> known;
  std::vector<Problem> result;
  for (const auto& [place, problem] : sorted) {
    if (known.emplace(to_string(problem->place), problem->message).second) {
      result.push_back(*problem);
    }
  }
  return result;
}

}  // namespace fastcycle::config
