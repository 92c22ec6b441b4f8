#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "config/load_options.h"
#include "config/problem.h"
#include "config/schema.h"
#include "config/value.h"
#include "config/variables.h"

namespace fastcycle::config {

/// Composes one tree from an application file and everything it names: included files, component
/// files, overlays and options.
///
/// The tree has the keys of an application without `$schema`, `variables` and `include`, and its
/// components are without `file`: all of these were resolved. A component of an included file has
/// its full namespace in `namespace`. So the tree is itself an equivalent application.
///
/// @threads  Confined to the thread that loads the configuration.
class Composer {
 public:
  static constexpr std::size_t kMaxIncludeDepth = 16;
  static constexpr std::size_t kMaxFiles = 1000;  // Files that include others twice multiply.

  Composer(const Schema& schema, Problems& problems) : schema_(schema), problems_(problems) {}

  /// The effective tree; none if the application's file cannot be read at all.
  [[nodiscard]] std::optional<Value> compose(const LoadOptions& options);

 private:
  [[nodiscard]] std::optional<Value> read(const std::filesystem::path& file, const Place& asked_at);

  // One file with all it includes. `stack` holds the files that are being included, outermost
  // first.
  Value compose_file(Value file, Variables& variables, std::vector<std::string>& stack);
  void substitute_members(Value& file, Variables& variables);
  void add_includes(Value& tree, const Value& file, std::vector<std::string>& stack);
  void add_include(Value& tree, const Value& include, std::vector<std::string>& stack);
  bool may_include(const Value& name, const std::vector<std::string>& stack);
  void add_part(Value& tree, const Value& part, const Value* name_space);
  void add_shared_params(Value& tree, const Value& part);
  void add_topic(Value& tree, const std::string& name, const Value& topic);
  void add_own(Value& tree, const Value& file, Variables& variables);
  void add_component(Value& tree, const Value& component, Variables& variables);
  void merge_component(Value& whole, const Value& component, Variables& variables);

  void apply_overlay(Value& tree, const Value& overlay, Variables& variables);
  void apply_overlay_component(Value& tree, const Value& over, Variables& variables);
  void apply_overlay_optional(Value& tree, const std::string& key, const Value& over);
  void apply_overlay_by_name(Value& list, const Value& over);
  void apply_overlay_topics(Value& tree, const Value& topics);
  void apply_set(Value& tree, const std::string& set);
  void isolate(Value& tree, const std::string& pattern);

  /// The component of the tree with the full name `name`; null if there is none.
  Value* find_component(Value& tree, const std::string& name);
  /// `did you mean "name"?`, or nothing.
  [[nodiscard]] std::string nearest_component(const Value& tree, const std::string& name) const;

  const Schema& schema_;
  Problems& problems_;
  std::size_t file_count_ = 0;
  // Index of each component in the tree, by its full name; of several with one name the first.
  // Filled when overlays or options need it.
  std::unordered_map<std::string, std::size_t> component_places_;
};

}  // namespace fastcycle::config
