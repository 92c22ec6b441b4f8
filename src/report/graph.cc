#include "report/graph.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "base/html.h"
#include "config/main_process.h"

namespace fastcycle::host {

namespace {

/// Light fills on which dark text is readable; executors use them in turn.
constexpr std::array kFills{"#dbeafe", "#dcfce7", "#ede9fe", "#ffedd5",
                            "#fce7f3", "#cffafe", "#ecfccb", "#e0e7ff"};
constexpr const char* kHead =
    "  graph [rankdir=LR, fontname=\"Helvetica\", fontsize=16, labelloc=t, nodesep=0.25, "
    "ranksep=0.7,\n"
    "         pad=0.3, bgcolor=\"white\"];\n"
    "  node [fontname=\"Helvetica\", fontsize=11, fontcolor=\"#0f172a\", penwidth=1.2,\n"
    "        margin=\"0.15,0.08\"];\n"
    "  edge [color=\"#64748b\", arrowsize=0.7, penwidth=1.2];\n";

std::string small_line(std::string_view text, const char* color) {
  return std::string("<br/><font point-size=\"9\" color=\"") + color + "\">" + base::to_html(text) +
         "</font>";
}

std::string notes_text(const std::vector<Drawing::Note>& notes) {
  std::string text;
  for (const Drawing::Note& note : notes) {
    text += small_line(note.text, note.is_bad ? "#dc2626" : "#0f766e");
  }
  return text;
}

/// A label: the name, and below it in small print `small` and the notes.
std::string label(std::string_view name, std::string_view small,
                  const std::vector<Drawing::Note>& notes) {
  return "<<b>" + base::to_html(name) + "</b>" +
         (small.empty() ? "" : small_line(small, "#475569")) + notes_text(notes) + ">";
}

/// The executors' fills, in the order in which components name them.
std::map<std::string, const char*> fills_of(const Drawing& drawing) {
  std::map<std::string, const char*> fills;
  for (const Drawing::Component& component : drawing.components) {
    fills.try_emplace(component.executor, kFills[fills.size() % kFills.size()]);
  }
  return fills;
}

/// The name of a component within its namespace.
std::string_view short_name(std::string_view name, std::string_view name_space) {
  return name_space.empty() ? name : name.substr(name_space.size() + 1);
}

/// A component's class or library, unless its name already contains it.
std::string about(const config::ComponentDescription& description) {
  std::vector<std::string> parts;
  if (description.library != short_name(description.name, description.name_space)) {
    parts.push_back(description.library);
  }
  if (!description.class_name.empty()) {
    parts.push_back(description.class_name);
  }
  if (description.serve_period) {
    std::array<char, 32> period{};
    std::snprintf(period.data(), period.size(), "every %g ms",
                  std::chrono::duration<double, std::milli>(*description.serve_period).count());
    parts.emplace_back(period.data());
  }
  if (!description.executor.empty()) {
    parts.push_back("on " + description.executor);
  }
  std::string text;
  for (const std::string& part : parts) {
    text += (text.empty() ? "" : " · ") + part;
  }
  return text;
}

std::string component_node(const Drawing::Component& component, const std::string& id,
                           const char* fill) {
  return id + " [shape=box, style=\"rounded,filled\", color=\"#334155\", fillcolor=\"" + fill +
         "\", label=" +
         label(short_name(component.name, component.name_space), component.about, component.notes) +
         "];\n";
}

std::string id_of(const Drawing& drawing, const std::string& component) {
  const auto found = std::ranges::find(drawing.components, component, &Drawing::Component::name);
  return "component_" + std::to_string(found - drawing.components.begin());
}

/// The components of one process, one frame per namespace; `frames` counts these.
std::string components_text(const Drawing& drawing, const std::string& process,
                            std::size_t& frames) {
  const auto fills = fills_of(drawing);
  std::map<std::string, std::string> nodes;
  for (const Drawing::Component& component : drawing.components) {
    if (component.process == process) {
      const std::string indent = component.name_space.empty() ? "  " : "    ";
      nodes[component.name_space] +=
          indent +
          component_node(component, id_of(drawing, component.name), fills.at(component.executor));
    }
  }
  std::string text;
  for (const auto& [name_space, inner] : nodes) {
    if (name_space.empty()) {
      text += inner;
      continue;
    }
    text += "  subgraph cluster_" + std::to_string(frames++) + " {\n    label=<" +
            base::to_html(name_space) +
            ">; fontsize=12; style=\"rounded\"; color=\"#cbd5e1\"; fontcolor=\"#475569\";\n" +
            inner + "  }\n";
  }
  return text;
}

/// One end of a topic as an edge; dashed if it causes no activation.
std::string edge(const std::string& from, const std::string& to, const Drawing::End& end) {
  std::string attributes = end.style;
  if (!end.note.text.empty()) {
    attributes += std::string(attributes.empty() ? "" : ", ") +
                  "fontname=\"Helvetica\", fontsize=9, fontcolor=\"" +
                  (end.note.is_bad ? "#dc2626\", color=\"#dc2626" : "#0f766e") + "\", label=<" +
                  base::to_html(end.note.text) + ">";
  }
  return "  " + from + " -> " + to + (attributes.empty() ? "" : " [" + attributes + "]") + ";\n";
}

std::string topic_node(const Drawing::Topic& topic, const std::string& id) {
  const char* look = "color=\"#a16207\", fillcolor=\"#fefce8\", style=\"filled\"";
  if (topic.publishers.empty()) {
    look = "color=\"#dc2626\", fillcolor=\"#fef2f2\", style=\"filled,dashed\"";
  }
  return "  " + id + " [shape=ellipse, " + look +
         ", label=" + label(topic.name, topic.type, topic.notes) + "];\n";
}

std::string edges_text(const Drawing& drawing, const Drawing::Topic& topic, const std::string& id) {
  std::string text;
  for (const Drawing::End& publisher : topic.publishers) {
    text += edge(id_of(drawing, publisher.component), id, publisher);
  }
  for (const Drawing::End& subscriber : topic.subscribers) {
    text += edge(id, id_of(drawing, subscriber.component), subscriber);
  }
  return text;
}

/// The process in which all ends of a topic are; none if it has ends in several, or no ends.
std::optional<std::string> process_of(const Drawing& drawing, const Drawing::Topic& topic) {
  std::set<std::string> processes;
  for (const auto* ends : {&topic.publishers, &topic.subscribers}) {
    for (const Drawing::End& end : *ends) {
      const auto component =
          std::ranges::find(drawing.components, end.component, &Drawing::Component::name);
      processes.insert(component == drawing.components.end() ? "" : component->process);
    }
  }
  return processes.size() == 1 ? std::optional(*processes.begin()) : std::nullopt;
}

/// The components, and the topics that do not leave one of several processes: in frames.
/// `is_framed` is set for these topics.
std::string nodes_text(const Drawing& drawing, std::vector<bool>& is_framed) {
  std::vector<std::string> processes;  // In the order in which components name them.
  for (const Drawing::Component& component : drawing.components) {
    if (std::ranges::find(processes, component.process) == processes.end()) {
      processes.push_back(component.process);
    }
  }
  std::size_t frames = 0;
  if (std::ranges::all_of(processes, &std::string::empty)) {
    return components_text(drawing, "", frames);
  }
  std::map<std::string, std::string> topics;
  for (std::size_t i = 0; i < drawing.topics.size(); ++i) {
    if (const auto process = process_of(drawing, drawing.topics[i])) {
      topics[*process] += topic_node(drawing.topics[i], "topic_" + std::to_string(i));
      is_framed[i] = true;
    }
  }
  std::string text;
  for (const std::string& process : processes) {
    const std::string inner = components_text(drawing, process, frames) + topics[process];
    text += "  subgraph cluster_" + std::to_string(frames++) + " {\n  label=<<b>" +
            base::to_html(process.empty() ? config::kMainProcess : process) +
            "</b> process>; fontsize=12; style=\"rounded,filled\"; color=\"#475569\"; " +
            "fillcolor=\"#f8fafc\"; fontcolor=\"#475569\"; margin=16;\n" + inner + "  }\n";
  }
  return text;
}

Drawing::Topic drawn(const detail::Topic& topic) {
  Drawing::Topic result{.name = topic.name, .type = topic.type};
  for (const auto& publisher : topic.publishers) {
    result.publishers.push_back({.component = publisher->owner.name,
                                 .style = publisher->options.is_external ? kExternalStyle : ""});
  }
  for (const auto& subscription : topic.subscriptions) {
    result.subscribers.push_back({.component = subscription->component,
                                  .style = subscription->is_called() ? "" : kLookingStyle});
  }
  return result;
}

}  // namespace

Drawing drawing_of(const Application& application) {
  Drawing drawing{.name = application.description().name};
  for (const auto& component : application.components()) {
    const config::ComponentDescription& description = component->description;
    drawing.components.push_back({.name = component->name,
                                  .name_space = description.name_space,
                                  .executor = description.executor,
                                  .process = description.process,
                                  .about = about(description)});
  }
  for (const auto& [name, topic] : application.topics().all()) {
    drawing.topics.push_back(drawn(*topic));
  }
  return drawing;
}

std::string to_dot(const Drawing& drawing) {
  std::string text = "digraph application {\n";
  text += kHead;
  text +=
      "  label=<<b>" + base::to_html(drawing.name) + "</b>" + notes_text(drawing.notes) + ">;\n\n";
  std::vector<bool> is_framed(drawing.topics.size(), false);
  text += nodes_text(drawing, is_framed) + "\n";
  for (std::size_t i = 0; i < drawing.topics.size(); ++i) {
    const std::string id = "topic_" + std::to_string(i);
    text += is_framed[i] ? std::string() : topic_node(drawing.topics[i], id);
    text += edges_text(drawing, drawing.topics[i], id);
  }
  return text + "}\n";
}

std::string to_dot(const Application& application) {
  return to_dot(drawing_of(application));
}

}  // namespace fastcycle::host
