#pragma once

#include <string>
#include <vector>

#include "host/application.h"

namespace fastcycle::host {

/// The contents of a graph of an application.
struct Drawing {
  /// A small line of measurements below a name; red if it is bad.
  struct Note {
    std::string text = {};
    bool is_bad = false;
  };

  struct Component {
    std::string name = {};        ///< Full name: `front/limiter`.
    std::string name_space = {};  ///< `front`; empty if it is in none.
    std::string executor = {};    ///< Nodes of one executor have the same color.
    std::string process = {};     ///< Empty: the initial process.
    std::string about = {};       ///< Its class or library.
    std::vector<Note> notes = {};
  };

  /// One end of a topic.
  struct End {
    std::string component = {};
    std::string style = {};  ///< Graphviz attributes; may be empty.
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

/// Style of an end that belongs to a driver's thread, or causes no activation.
inline constexpr const char* kExternalStyle = "style=bold, tooltip=\"from a thread\"";
inline constexpr const char* kLookingStyle = "style=dashed";

/// The drawing of a built application.
[[nodiscard]] Drawing drawing_of(const Application& application);

/// A graph in Graphviz's DOT: components are boxes, topics ellipses; each namespace is a frame. If
/// components are in several processes, each process is a frame with its components, and with the
/// topics that do not leave it.
[[nodiscard]] std::string to_dot(const Drawing& drawing);
[[nodiscard]] std::string to_dot(const Application& application);

}  // namespace fastcycle::host
