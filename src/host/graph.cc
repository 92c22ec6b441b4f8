#include "host/graph.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <map>
#include <string_view>
#include <vector>

namespace fastcycle::host {

using detail::ComponentCore;

namespace {

/// Light fills that a dark text is read on well; executors take turns.
constexpr std::array kFills{"#dbeafe", "#dcfce7", "#ede9fe", "#ffedd5",
                            "#fce7f3", "#cffafe", "#ecfccb", "#e0e7ff"};
constexpr const char* kHead =
    "  graph [rankdir=LR, fontname=\"Helvetica\", fontsize=16, labelloc=t, nodesep=0.25, "
    "ranksep=0.7,\n"
    "         pad=0.3, bgcolor=\"white\"];\n"
    "  node [fontname=\"Helvetica\", fontsize=11, fontcolor=\"#0f172a\", penwidth=1.2,\n"
    "        margin=\"0.15,0.08\"];\n"
    "  edge [color=\"#64748b\", arrowsize=0.7, penwidth=1.2];\n";

/// `text` inside a label that is written as HTML.
std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

/// A label: what it is called, and small, below that, what it is.
std::string label(std::string_view name, std::string_view small) {
  const std::string below =
      "<br/><font point-size=\"9\" color=\"#475569\">" + escaped(small) + "</font>";
  return "<<b>" + escaped(name) + "</b>" + (small.empty() ? "" : below) + ">";
}

std::string id_of(const ComponentCore& component) {
  return "component_" + std::to_string(component.index);
}

/// The executors' fills, in the order in which components name them.
std::map<std::string, const char*> fills_of(const Application& application) {
  std::map<std::string, const char*> fills;
  for (const auto& component : application.components()) {
    fills.try_emplace(component->description.executor, kFills[fills.size() % kFills.size()]);
  }
  return fills;
}

/// What a component is made of, unless its name says it.
std::string about(const config::ComponentDescription& description, std::string_view name) {
  std::vector<std::string> parts;
  if (description.library != name) {
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

std::string component_node(const ComponentCore& component, const char* fill) {
  const config::ComponentDescription& description = component.description;
  std::string_view name = description.name;
  if (!description.name_space.empty()) {
    name.remove_prefix(description.name_space.size() + 1);
  }
  return id_of(component) +
         " [shape=box, style=\"rounded,filled\", color=\"#334155\", fillcolor=\"" + fill +
         "\", label=" + label(name, about(description, name)) + "];\n";
}

/// The components, those of one namespace in one frame.
std::string components_text(const Application& application) {
  const auto fills = fills_of(application);
  std::map<std::string, std::string> nodes;
  for (const auto& component : application.components()) {
    const config::ComponentDescription& description = component->description;
    const std::string indent = description.name_space.empty() ? "  " : "    ";
    nodes[description.name_space] +=
        indent + component_node(*component, fills.at(description.executor));
  }
  std::string text;
  std::size_t frame = 0;
  for (const auto& [name_space, inner] : nodes) {
    if (name_space.empty()) {
      text += inner;
      continue;
    }
    text += "  subgraph cluster_" + std::to_string(frame++) + " {\n    label=<" +
            escaped(name_space) +
            ">; fontsize=12; style=\"rounded\"; color=\"#cbd5e1\"; fontcolor=\"#475569\";\n" +
            inner + "  }\n";
  }
  return text;
}

/// How one end of a topic is drawn; what causes no activation is dashed.
std::string edge(const std::string& from, const std::string& to, const char* style) {
  return "  " + from + " -> " + to + (*style == '\0' ? "" : " [" + std::string(style) + "]") +
         ";\n";
}

std::string topic_text(const Application& application, const detail::Topic& topic,
                       const std::string& id) {
  const char* look = "color=\"#a16207\", fillcolor=\"#fefce8\", style=\"filled\"";
  if (topic.publishers.empty()) {
    look = "color=\"#dc2626\", fillcolor=\"#fef2f2\", style=\"filled,dashed\"";
  }
  std::string text =
      "  " + id + " [shape=ellipse, " + look + ", label=" + label(topic.name, topic.type) + "];\n";
  const auto id_of_name = [&](const std::string& name) {
    const auto& components = application.components();
    const auto found = std::find_if(components.begin(), components.end(),
                                    [&](const auto& component) { return component->name == name; });
    return id_of(**found);
  };
  for (const auto& publisher : topic.publishers) {
    text += edge(id_of_name(publisher->owner.name), id,
                 publisher->options.is_external ? "style=bold, tooltip=\"from a thread\"" : "");
  }
  for (const auto& subscription : topic.subscriptions) {
    text += edge(id, id_of_name(subscription->component),
                 subscription->is_called() ? "" : "style=dashed");
  }
  return text;
}

}  // namespace

std::string to_dot(const Application& application) {
  std::string text = "digraph application {\n";
  text += kHead;
  text += "  label=<<b>" + escaped(application.description().name) + "</b>>;\n\n";
  text += components_text(application) + "\n";
  std::size_t number = 0;
  for (const auto& [name, topic] : application.topics().all()) {
    text += topic_text(application, *topic, "topic_" + std::to_string(number++));
  }
  return text + "}\n";
}

}  // namespace fastcycle::host
