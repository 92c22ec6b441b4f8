#pragma once

#include <string>
#include <vector>

#include "host/application.h"

namespace fastcycle::host {

/// What a graph shows of an application.
struct Drawing {
  /// A small line below a name, of what is measured; one that is bad is red.
  struct Note {
    std::string text = {};
    bool is_bad = false;
  };

  struct Component {
    std::string name = {};        ///< Whole: `front/limiter`.
    std::string name_space = {};  ///< `front`; empty if it is in none.
    std::string executor = {};    ///< Those of one have one colour.
    std::string process = {};     ///< Empty: the one that was started.
    std::string about = {};       ///< What it is made of.
    std::vector<Note> notes = {};
  };

  /// One end of a topic.
  struct End {
    std::string component = {};
    std::string style = {};  ///< Of Graphviz; may be empty.
    Note note = {};
  };

  struct Topic {
    std::string name = {};
    std::string type = {};
    std::vector<End> publishers = {};
    std::vector<End> subscribers = {};
    std::vector<Note> notes = {};
  };

  std::string name = {};
  std::vector<Component> components = {};
  std::vector<Topic> topics = {};
  std::vector<Note> notes = {};
};

/// How an end is drawn that comes from a thread of a driver, or that causes no activation.
inline constexpr const char* kExternalStyle = "style=bold, tooltip=\"from a thread\"";
inline constexpr const char* kLookingStyle = "style=dashed";

/// `application`, which is built.
[[nodiscard]] Drawing drawing_of(const Application& application);

/// A graph in Graphviz's DOT: components are boxes, topics ellipses; what comes from one namespace
/// stands in one frame. Where components are in several processes, each is a frame with its
/// components, and with the topics that do not leave it.
[[nodiscard]] std::string to_dot(const Drawing& drawing);
[[nodiscard]] std::string to_dot(const Application& application);

}  // namespace fastcycle::host
