#include "host/reloads.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <set>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/build_id.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/time_driver.h"
#include "component/wiring.h"
#include "component/words.h"
#include "config/merge.h"
#include "config/parse.h"
#include "executor/subscriptions.h"
#include "host/declared_wiring.h"
#include "loading/component_library.h"
#include "loading/trial.h"
#include "modes/chains.h"

namespace fastcycle::host {

using config::Value;
using detail::ComponentCore;
using detail::LifeStep;

namespace {

/// Its messages, in one text.
std::string text_of(const config::Problems& problems) {
  std::string text;
  for (const config::Problem& problem : problems.all()) {
    if (!problem.warning) {
      text += (text.empty() ? "" : "; ") + problem.message +
              (problem.hint.empty() ? "" : " (" + problem.hint + ")");
    }
  }
  return text;
}

/// `text` as a JSON object; none after adding to `problems`. The text may be empty.
std::optional<Value> params_of(const std::string& text, config::Problems& problems) {
  if (text.empty()) {
    return std::nullopt;
  }
  const auto source = std::make_shared<config::Source>(config::Source{"params", {}, true});
  const auto params = config::parse(text, source, problems);
  if (params && !params->is_object()) {
    problems.add(config::make_error(params->place(), "the params are no JSON object"));
    return std::nullopt;
  }
  return params;
}

/// The part of the application file that the trial of one component needs.
Value part_of(const config::ApplicationDescription& application, const std::string& component,
              const ReloadRequest& request, const std::optional<Value>& params) {
  Value tree = application.effective;
  for (const std::string& key : config::keys_of(tree)) {
    if (key != "name" && key != "params" && key != "components") {
      tree.erase(key);
    }
  }
  Value* const components = tree.find("components");
  std::erase_if(components->items(),
                [&](const Value& one) { return config::full_name(one) != component; });
  for (Value& its : components->items()) {
    for (const char* key : {"after", "executor", "process", "fault_mode", "class", "threads"}) {
      its.erase(key);
    }
    if (!request.class_name.empty()) {
      its.set("class", Value::string_at(its, request.class_name));
    }
    if (params) {
      config::Problems ignored;  // Both are objects.
      Value merged = its.find("params") != nullptr ? *its.find("params") : Value::object_at(its);
      config::merge(merged, *params, ignored);
      its.set("params", std::move(merged));
    }
  }
  return tree;
}

using Ends = std::multiset<std::tuple<std::string, std::string, std::string>>;

/// The declarations of a running component: role, topic name and type.
Ends ends_of(const ComponentCore& core) {
  Ends ends;
  for (const detail::PublisherCore* publisher : core.declared.publishers) {
    ends.emplace("publishes", publisher->topic.name, publisher->topic.type);
  }
  for (const detail::CallbackSubscription* subscription : core.declared.subscriptions) {
    ends.emplace("subscribes to", subscription->topic.name, subscription->topic.type);
  }
  for (const detail::View* view : core.declared.views) {
    ends.emplace("keeps a view of", view->topic.name, view->topic.type);
  }
  return ends;
}

/// The same of a component that was tried.
Ends ends_of(const ApplicationWiring& wiring) {
  Ends ends;
  for (const auto& publisher : wiring.publishers) {
    ends.emplace("publishes", publisher.topic, publisher.type);
  }
  for (const auto& subscription : wiring.subscriptions) {
    ends.emplace(subscription.is_called ? "subscribes to" : "keeps a view of", subscription.topic,
                 subscription.type);
  }
  return ends;
}

/// Why a component with `now` cannot take the place of one with `before`; empty if it can.
std::string difference(const Ends& before, const Ends& now) {
  const auto in_words = [](const Ends& some, const Ends& others, const char* how) {
    std::string text;
    Ends left;
    std::ranges::set_difference(some, others, std::inserter(left, left.end()));
    for (const auto& [what, topic, type] : left) {
      text += fmt::format("{}{} {} \"{}\" ({})", text.empty() ? "" : ", ", how, what, topic, type);
    }
    return text;
  };
  const std::string more = in_words(now, before, "it");
  const std::string less = in_words(before, now, "it no longer");
  const std::string all = more + (more.empty() || less.empty() ? "" : ", ") + less;
  return all.empty() ? ""
                     : all +
                           ": publishers, subscriptions, views and states have to stay as they "
                           "are while the application runs";
}

}  // namespace

Reloads::Reloads(ApplicationHost& application, const Wiring& wiring, const Chains& chains,
                 LifeChanges& life_changes)
    : application_(application),
      wiring_(wiring),
      chains_(chains),
      life_changes_(life_changes),
      versions_(application.description().libraries) {
  life_changes_.on_reload = [this](ComponentCore& component, const nlohmann::json& order,
                                   LifeChanges::Done done) {
    make_here(component, order, std::move(done));
  };
}

Reloads::~Reloads() {
  end();
  if (trial_.joinable()) {
    trial_.join();
  }
}

void Reloads::end() {
  const std::lock_guard lock(mutex_);
  is_over_ = true;
}

/// Whether the activations of the component are executed in another process too.
bool Reloads::is_followed(const ComponentCore& component) const {
  const config::ApplicationDescription& application = application_.description();
  const bool has_standby = std::ranges::any_of(application.processes, [&](const auto& process) {
    return process.has_standby && process.name == component.description.process;
  });
  return !application_.clock().is_simulated() &&
         (has_standby || std::ranges::any_of(application.shadows, [&](const auto& shadow) {
            return shadow.of == component.name;
          }));
}

void Reloads::reload(ComponentCore& component, const ReloadRequest& request,
                     LifeChanges::Done done) {
  if (is_followed(component)) {
    done(
        "another process follows it, as its standby or its shadow, and would not have the new code",
        {});
    return;
  }
  std::thread before;
  {
    const std::lock_guard lock(mutex_);
    if (is_over_ || is_trying_) {
      done(is_over_ ? "the application stops" : "another library is being tried", {});
      return;
    }
    is_trying_ = true;
    before = std::move(trial_);
  }
  if (before.joinable()) {
    before.join();  // It has nothing left to do.
  }
  std::thread trial([this, &component, request, done = std::move(done)] {
    config::Problems problems;
    std::optional<nlohmann::json> order;
    try {
      order = try_out(component, request, problems);
    } catch (const std::exception& exception) {
      problems.add(config::make_error({}, exception.what()));
    }
    const bool is_over = [this] {
      const std::lock_guard lock(mutex_);
      is_trying_ = false;
      return is_over_;
    }();
    if (!order || is_over) {
      done(is_over ? "the application stops" : text_of(problems), {});
    } else {
      life_changes_.reload(component, *order, done);
    }
  });
  const std::lock_guard lock(mutex_);
  trial_ = std::move(trial);
}

std::filesystem::path Reloads::find(const std::string& library, config::Problems& problems) const {
  namespace fs = std::filesystem;
  std::error_code error;
  if (library.ends_with(".so")) {
    const fs::path file = fs::canonical(library, error);
    if (error) {
      problems.add(config::make_error({}, fmt::format("library \"{}\" was not found", library)));
    }
    return file;
  }
  const auto folders = library_folders(application_.description(), library_path_);
  const fs::path found = LibraryLoader(folders).file_of(library);
  if (found.empty()) {
    std::string all;
    for (const fs::path& folder : folders) {
      all += (all.empty() ? "" : ", ") + folder.string();
    }
    problems.add(config::make_error({}, fmt::format("library \"{}\" was not found: no {} in {}",
                                                    library, library_file(library).string(), all)));
  }
  return found;
}

std::optional<nlohmann::json> Reloads::try_out(const ComponentCore& component,
                                               const ReloadRequest& request,
                                               config::Problems& problems) {
  const auto params = params_of(request.params, problems);
  const std::filesystem::path file = find(request.library, problems);
  if (problems.has_errors()) {
    return std::nullopt;
  }
  const config::ApplicationDescription& description = application_.description();
  TriedLibrary tried{.name = request.library, .file = file, .others = {}};
  for (const config::ComponentDescription& other : description.components) {
    if (!other.library.empty()) {
      tried.others.push_back(other.library);
    }
  }
  const TrialResult result = try_library(
      {.load = {.file = description.file,
                .text = part_of(description, component.name, request, params).to_text()},
       .library_path = library_path_,
       .on_throw = ConstructorFault::kError,
       .library = std::move(tried)},
      problems);
  if (problems.has_errors()) {
    return std::nullopt;
  }
  return nlohmann::json{{"library", request.library},
                        {"file", file.string()},
                        {"class", request.class_name},
                        {"params", request.params},
                        {"probation_ns", request.probation.count()},
                        {"misses_forgiven", request.misses_forgiven},
                        {"sha256", result.sha256},
                        {"wiring", result.wiring}};
}

void Reloads::make_here(ComponentCore& component, const nlohmann::json& asked,
                        LifeChanges::Done done) {
  config::Problems problems;
  const auto order = std::make_shared<detail::ReloadOrder>();
  const std::string library = asked.at("library");
  const auto opened =
      versions_.open(library, asked.at("file").get<std::string>(), asked.at("sha256"), problems);
  if (opened.library != nullptr) {
    config::ComponentDescription described = component.description;
    described.library = library;
    described.class_name = asked.at("class");
    if (const ComponentClass* its_class = class_of(*opened.library, described, problems)) {
      order->version = {
          .component_class = *its_class,
          .library = library,
          .build_id = base::build_id_at(reinterpret_cast<const void*>(its_class->create))};
    }
  }
  order->params = params_of(asked.at("params"), problems);
  order->probation = Duration(asked.at("probation_ns").get<std::int64_t>());
  order->misses_forgiven = asked.at("misses_forgiven");
  if (problems.has_errors()) {
    done(text_of(problems), to_word(component.state.load()));
    return;
  }
  const std::string differs =
      difference(ends_of(component), ends_of(wiring_from_text(asked.at("wiring"))));
  if (!differs.empty()) {
    done(differs, to_word(component.state.load()));
    return;
  }
  order->on_result = [this, &component, done = std::move(done)](const std::string& why_not) {
    if (why_not.empty()) {
      BreachCounts counts = breaches_of(component.name);
      const std::lock_guard lock(mutex_);
      breach_counts_[component.name] = std::move(counts);
    }
    done(why_not, to_word(component.state.load()));
  };
  application_.time().between_rounds([&component, order] {
    component.post(
        detail::Cause::kMode, [&component, order] { component.versions->reload(order); }, nullptr,
        detail::to_key(LifeStep::kReload));
  });
}

// ---- Components on probation ----

bool Reloads::is_anyone_on_probation() const {
  return std::ranges::any_of(application_.components(), [](const auto& component) {
    return component->versions->is_on_probation();
  });
}

Reloads::BreachCounts Reloads::breaches_of(const std::string& component) const {
  BreachCounts counts;
  for (const ChainReport& chain : chains_.report()) {
    for (const HopReport& hop : chain.hops) {
      if (hop.component == component) {
        counts[chain.name] += hop.breaches();
      }
    }
  }
  return counts;
}

void Reloads::deadline_missed(const QosEvent& event) {
  if (!is_anyone_on_probation()) {
    return;
  }
  std::set<std::string> publishers{std::string(event.publisher)};
  if (event.publisher.empty()) {
    wiring_.look([&](const detail::Topics& topics) {
      if (const detail::Topic* topic = topics.find(std::string(event.topic))) {
        for (const auto& publisher : topic->publishers) {
          publishers.insert(publisher->owner.name);
        }
      }
    });
  }
  for (const auto& component : application_.components()) {
    if (publishers.contains(component->name)) {
      component->versions->note_miss(fmt::format("that of \"{}\"", event.topic));
    }
  }
}

void Reloads::chain_breached(std::size_t) {
  if (!is_anyone_on_probation()) {
    return;
  }
  for (const auto& component : application_.components()) {
    if (!component->versions->is_on_probation()) {
      continue;
    }
    const BreachCounts now = breaches_of(component->name);
    BreachCounts before;
    {
      const std::lock_guard lock(mutex_);
      before = std::exchange(breach_counts_[component->name], now);
    }
    for (const auto& [chain, breaches] : now) {
      for (std::uint64_t i = before[chain]; i < breaches; ++i) {
        component->versions->note_miss(fmt::format("that of the chain \"{}\"", chain));
      }
    }
  }
}

}  // namespace fastcycle::host
