#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <string>
#include <string_view>

#include "fastcycle/component.h"
#include "fastcycle/version.h"

namespace fastcycle {

/// How the host constructs and destroys components of one class.
struct ComponentClass {
  /// The class's name, without namespaces: `"class"` of the application file.
  const char* name;
  /// Constructs one; exceptions of its constructor propagate.
  Component* (*create)(Context& context);
  /// Destroys `component`; returns false, with the exception's text in `error`, if its destructor
  /// threw.
  bool (*destroy)(Component* component, std::string& error) noexcept;
  /// Whether it overrides `serve`, which is called only if `"serve_period_ms"` is configured.
  bool overrides_serve = false;
};

/// The contents of a component library, and its only export.
struct ComponentLibrary {
  /// `kInterfaceVersion` of the headers that it was compiled with.
  std::uint32_t interface_version;
  /// The number of `classes`.
  std::size_t class_count;
  /// Its classes, in the order of `FASTCYCLE_COMPONENTS`.
  const ComponentClass* classes;
};

/// Version of the interface between host and component library; raised with each incompatible
/// change.
inline constexpr std::uint32_t kInterfaceVersion = 2;

namespace detail {

/// The type names in "A, ns::B", without namespaces.
template <std::size_t N>
std::array<std::string, N> split_names(std::string_view list) {
  std::array<std::string, N> names;
  for (std::string& name : names) {
    const auto end = list.find(',');
    std::string_view word = list.substr(0, end);
    word.remove_prefix(word.find_first_not_of(' '));
    if (const auto scope = word.rfind(':'); scope != std::string_view::npos) {
      word.remove_prefix(scope + 1);
    }
    name.assign(word.begin(), word.end());
    list.remove_prefix(end == std::string_view::npos ? list.size() : end + 1);
  }
  return names;
}

template <std::derived_from<Component> T>
Component* create_component(Context& context) {
  return new T(context);
}

/// Whether `T`, or a class between it and `Component`, overrides `serve`. An inaccessible `serve`
/// is an override too: that of `Component` is public.
template <std::derived_from<Component> T>
constexpr bool overrides_serve() {
  return !requires {
    { &T::serve } -> std::same_as<void (Component::*)()>;
  };
}

/// Destroys inside the library: a destructor that throws must not end the process.
template <std::derived_from<Component> T>
bool destroy_component(Component* component, std::string& error) noexcept {
  try {
    delete static_cast<T*>(component);
    return true;
  } catch (const std::exception& exception) {
    error = exception.what();
  } catch (...) {
    error = "something that is no std::exception";
  }
  return false;
}

/// The classes of a library; `names` are its type names, separated by commas.
template <std::derived_from<Component>... T>
const ComponentLibrary* library_of(const char* names) {
  static const std::array<std::string, sizeof...(T)> kNames = split_names<sizeof...(T)>(names);
  static const auto kClasses = [] {
    std::size_t index = 0;
    return std::array<ComponentClass, sizeof...(T)>{
        ComponentClass{kNames[index++].c_str(), &create_component<T>, &destroy_component<T>,
                       overrides_serve<T>()}...};
  }();
  static const ComponentLibrary kLibrary{kInterfaceVersion, sizeof...(T), kClasses.data()};
  return &kLibrary;
}

/// An ELF note with the versions that the library was built with, readable without loading it. The
/// host compares the text with its own, which must be equal.
struct LibraryNote {
  std::uint32_t name_size = 10;
  std::uint32_t text_size = 128;
  std::uint32_t type = 1;
  char name[12] = "FastCycle";
  char text[128];
};

}  // namespace detail
}  // namespace fastcycle

/// Exports component classes to the host. Used once in a library, at namespace scope.
#define FASTCYCLE_COMPONENTS(...)                                                           \
  __attribute__((                                                                           \
      section(".note.fastcycle"), used,                                                     \
      aligned(4))) static const ::fastcycle::detail::LibraryNote fastcycle_library_note = { \
      .text = FASTCYCLE_BUILD_NOTE};                                                        \
  extern "C" __attribute__((visibility("default"))) const ::fastcycle::ComponentLibrary*    \
  fastcycle_component_library_v1() {                                                        \
    return ::fastcycle::detail::library_of<__VA_ARGS__>(#__VA_ARGS__);                      \
  }

/// Exports one component class to the host.
#define FASTCYCLE_COMPONENT(Class) FASTCYCLE_COMPONENTS(Class)
