#include "python_component.h"

#include <array>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include <dlfcn.h>
#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "broker/activation_check.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "config/nearest.h"
#include "interpreter.h"
#include "loading/component_library.h"

namespace py = pybind11;
namespace pb = google::protobuf;
namespace fs = std::filesystem;

namespace fastcycle::python {
namespace {

constexpr std::array kMethodNames = {"start", "activate", "deactivate", "serve", "stop"};

/// The subclasses of `fastcycle.component.Component` that `module` defines itself.
std::vector<std::string> classes_of(const py::module_& module, const py::handle& base) {
  std::vector<std::string> names;
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>()) {
    if (PyType_Check(value.ptr()) != 0 && !value.is(base) &&
        PyObject_IsSubclass(value.ptr(), base.ptr()) == 1 &&
        value.attr("__module__").equal(module.attr("__name__"))) {
      names.push_back(name.cast<std::string>());
    }
  }
  return names;
}

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) {
    list += (list.empty() ? "\"" : ", \"") + name + "\"";
  }
  return list;
}

/// "a directory", "no such file".
std::string look_at(const fs::path& file) {
  std::error_code error;
  const auto kind = fs::status(file, error).type();
  return kind == fs::file_type::directory   ? "a folder"
         : kind == fs::file_type::not_found ? "no such file"
         : kind == fs::file_type::regular   ? "a file of another name"
                                            : "something else";
}

}  // namespace

/// Its Python objects: freed with the GIL.
struct PythonComponent::Objects {
  py::object self;
  std::vector<py::object> callbacks;
  std::array<py::object, static_cast<std::size_t>(Method::kCount)> methods;  ///< Or null.
  std::vector<std::unique_ptr<Lent>> lent;  ///< Lent to the running call.
};

PythonComponent::PythonComponent(Context& context)
    : Component(context), objects_(std::make_unique<Objects>()) {
  using Texts = std::vector<std::string>;
  const Path file = context.param<Path>("python.file", {.fallback = Path()}).get();
  const std::string module = context.param<std::string>("python.module", {.fallback = ""}).get();
  const std::string name = context.param<std::string>("python.class", {.fallback = ""}).get();
  const auto packages = context.param<Texts>("python.messages", {.fallback = Texts()}).get();
  if (file.empty() == module.empty()) {
    refuse("python", "either \"file\" or \"module\"", file.empty() ? "none of them" : "both",
           "\"params\": {\"python\": {\"file\": \"follower.py\"}} names a file of Python");
  }
  load_messages(packages);
  warn_of_shared_executor();
  start_interpreter();
  const Gil gil;
  try {
    make_message_types();
    make_bindings();
    make_object(file, module, name);
  } catch (py::error_already_set& error) {
    const std::string what = in_words(error);
    objects_.reset();
    link_->is_there = false;
    throw std::runtime_error(what);
  } catch (...) {
    objects_.reset();
    link_->is_there = false;
    throw;
  }
}

PythonComponent::~PythonComponent() {
  if (!is_interpreter_there()) {
    static_cast<void>(objects_.release());  // They can no longer be freed.
    return;
  }
  const Gil gil;
  objects_.reset();
  PyGC_Collect();  // Reference cycles keep messages and loans, too.
  link_->is_there = false;
}

void PythonComponent::refuse(std::string_view name, std::string expected, std::string found,
                             std::string hint) {
  detail::ComponentCore& core = context().core();
  const config::Value* value = core.description.params.find_dotted(name);
  config::Problem problem;
  problem.place = value == nullptr ? core.description.place : value->place();
  problem.message =
      fmt::format("component \"{}\": {}expected {}, found {}", core.name,
                  value == nullptr ? fmt::format("\"{}\": ", name) : "", expected, found);
  problem.expected = std::move(expected);
  problem.found = std::move(found);
  problem.hint = std::move(hint);
  std::string what = problem.message;
  core.problems->add(std::move(problem));
  throw std::runtime_error(std::move(what));
}

void PythonComponent::warn(const std::string& what, const std::string& hint) {
  detail::ComponentCore& core = context().core();
  config::Problem problem = config::make_error(
      core.description.place, fmt::format("component \"{}\": {}", core.name, what), hint);
  problem.warning = true;
  core.problems->add(std::move(problem));
}

void PythonComponent::warn_of_shared_executor() {
  const detail::ComponentCore& core = context().core();
  for (const config::ComponentDescription& other : core.application.description().components) {
    if (other.executor == core.description.executor && other.library != core.description.library) {
      warn(fmt::format("it runs Python on the executor of \"{}\", which waits for it, and for "
                       "whatever else runs Python",
                       other.name),
           "give it one of its own: \"executors\": [{\"name\": \"python\"}], and \"executor\": "
           "\"python\" of the component");
      return;
    }
  }
}

void PythonComponent::load_messages(const std::vector<std::string>& packages) {
  const config::ApplicationDescription& application = context().core().application.description();
  std::vector<fs::path> folders = host::library_folders(application, {});
  folders.push_back(host::core_library_folder());
  for (const std::string& package : packages) {
    fs::path found = host::library_file(package);  // Else in the system's search path.
    for (const fs::path& folder : folders) {
      std::error_code ignored;
      if (fs::exists(folder / host::library_file(package), ignored)) {
        found = folder / host::library_file(package);
        break;
      }
    }
    if (dlopen(found.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE) == nullptr) {
      refuse("python.messages", "libraries of message packages",
             fmt::format("\"{}\", which cannot be loaded: {}", package, dlerror()));
    }
  }
}

void PythonComponent::make_object(const Path& file, const std::string& module_name,
                                  const std::string& class_name) {
  std::error_code ignored;
  if (!file.empty() && (file.extension() != ".py" || !fs::is_regular_file(file, ignored))) {
    refuse("python.file", "a Python file, *.py",
           fmt::format("\"{}\", {}", file.string(), look_at(file)));
  }
  const py::object base = py::module_::import("fastcycle.component").attr("Component");
  py::module_ module;
  try {
    module = file.empty() ? py::module_::import(module_name.c_str()) : import_file(file);
  } catch (py::error_already_set& error) {
    refuse(file.empty() ? "python.module" : "python.file", "Python that can be imported",
           in_words(error));
  }
  const std::vector<std::string> known = classes_of(module, base);
  std::string name = class_name;
  if (name.empty()) {
    if (known.size() != 1) {
      refuse("python", "a \"class\", as there is not exactly one",
             known.empty() ? "no subclass of fastcycle.component.Component"
                           : "the classes " + list_of(known));
    }
    name = known.front();
  }
  const py::object its_class = py::getattr(module, name.c_str(), py::none());
  if (PyType_Check(its_class.ptr()) == 0 || PyObject_IsSubclass(its_class.ptr(), base.ptr()) != 1) {
    refuse("python.class",
           "a subclass of fastcycle.component.Component in " +
               (file.empty() ? module_name : file.string()),
           "\"" + name + "\"", config::name_hint(name, known));
  }
  for (std::size_t i = 0; i < kMethodNames.size(); ++i) {
    const bool is_own = !its_class.attr(kMethodNames[i]).is(base.attr(kMethodNames[i]));
    const bool is_called = Method(i) != Method::kServe || context().core().description.serve_period;
    if (is_own && !is_called) {
      warn("serve() of its class " + name +
               " is never called, because the component has no \"serve_period_ms\"",
           "say how often it is called, or remove serve() from the class");
    }
  }
  objects_->self = its_class(make_context(*this));
  for (std::size_t i = 0; i < kMethodNames.size(); ++i) {
    if (!its_class.attr(kMethodNames[i]).is(base.attr(kMethodNames[i]))) {
      objects_->methods[i] = objects_->self.attr(kMethodNames[i]);
    }
  }
}

template <typename F>
void PythonComponent::run(F body) {
  const Gil gil;
  struct LetGo {
    Objects& objects;
    ~LetGo() { objects.lent.clear(); }
  };
  std::string what;
  {
    const LetGo let_go{*objects_};
    try {
      body();
      return;
    } catch (py::error_already_set& error) {
      what = in_words(error);
    }
  }
  throw std::runtime_error(what);
}

void PythonComponent::call(Method method) {
  const py::object& callable = objects_->methods[static_cast<std::size_t>(method)];
  if (callable.ptr() != nullptr) {
    run([&] { callable(); });
  }
}

std::function<void()> PythonComponent::call_back(py::object callback) {
  const std::size_t index = objects_->callbacks.size();
  objects_->callbacks.push_back(std::move(callback));
  return [this, index] { run([&] { objects_->callbacks[index](); }); };
}

detail::EnvelopeCallback PythonComponent::call_back_with_message(
    py::object callback, std::shared_ptr<detail::Holder> holder) {
  const std::size_t index = objects_->callbacks.size();
  objects_->callbacks.push_back(std::move(callback));
  return [this, index, holder = std::move(holder)](detail::Envelope& envelope,
                                                   const pb::Message& payload) {
    run([&] {
      const Lent lent(envelope, payload, *holder);
      std::string what;
      try {
        PyObject* const result =
            PyObject_CallOneArg(objects_->callbacks[index].ptr(), lent.object().ptr());
        if (result == nullptr) {
          what = take_exception();  // Before `lent` ends: the traceback keeps the message alive.
        }
        Py_XDECREF(result);
      } catch (const std::exception& exception) {
        what = exception.what();
      }
      if (!what.empty()) {
        throw std::runtime_error(what);
      }
    });
  };
}

py::object PythonComponent::lend(detail::Envelope& envelope, detail::Holder holder) {
  objects_->lent.push_back(std::make_unique<Lent>(envelope, *envelope.payload, holder));
  return objects_->lent.back()->object();
}

const pb::Message& PythonComponent::type_named(const std::string& name) const {
  const pb::Descriptor* const found =
      pb::DescriptorPool::generated_pool()->FindMessageTypeByName(name);
  if (found == nullptr) {
    throw std::invalid_argument(fmt::format(
        "expected the full name of a message type, found \"{}\", which no library that is loaded "
        "has; name its message package in the params: \"python\": {{\"messages\": "
        "[\"{}_messages\"]}}",
        name, name.substr(0, name.find('.'))));
  }
  prepare_for(*found);
  return *pb::MessageFactory::generated_factory()->GetPrototype(found);
}

void PythonComponent::check_constructing(std::string_view call) {
  if (!context().core().is_constructing) {
    throw std::runtime_error(
        fmt::format("{} outside of the constructor: a component declares all it has there", call));
  }
}

void PythonComponent::check_in_call(std::string_view call) {
  if (!detail::is_in_activation_of(context().core().publishing)) {
    throw std::runtime_error(fmt::format(
        "{} outside of a callback: a component does so in its own callbacks, not in its "
        "constructor and not on threads",
        call));
  }
}

namespace {

constexpr ComponentClass kClass{"PythonComponent", &detail::create_component<PythonComponent>,
                                &detail::destroy_component<PythonComponent>};
// Not FASTCYCLE_COMPONENT: only the Python class determines whether there is a serve().
constexpr ComponentLibrary kLibrary{kInterfaceVersion, 1, &kClass};

}  // namespace
}  // namespace fastcycle::python

__attribute__((section(".note.fastcycle"), used,
               aligned(4))) static const fastcycle::detail::LibraryNote fastcycle_library_note = {
    .text = FASTCYCLE_BUILD_NOTE};

extern "C" __attribute__((visibility("default"))) const fastcycle::ComponentLibrary*
fastcycle_component_library_v1() {
  return &fastcycle::python::kLibrary;
}
