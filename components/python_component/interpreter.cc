#include "interpreter.h"

#include <cstdlib>
#include <mutex>
#include <stdexcept>
#include <vector>

#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/auxv.h>

#include "base/printable.h"
#include "loading/component_library.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace fastcycle::python {
namespace {

/// Extension modules, such as those of NumPy, look up Python's functions among the global symbols
/// of the process, but this library, and Python with it, were loaded with local ones.
void share_symbols() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&Py_IsInitialized), &info) != 0 &&
      info.dli_fname != nullptr) {
    dlopen(info.dli_fname, RTLD_NOW | RTLD_GLOBAL | RTLD_NOLOAD);
  }
}

/// The `python3` whose modules are used: that of a virtual environment, or the one of the build,
/// whatever `python3` is in PATH.
std::string find_program(bool is_trusted) {
  const char* const environment = std::getenv("VIRTUAL_ENV");
  if (is_trusted && environment != nullptr) {
    std::error_code ignored;
    const fs::path program = fs::path(environment) / "bin" / fs::path(FASTCYCLE_PYTHON).filename();
    if (fs::exists(program, ignored)) {
      return program.string();
    }
  }
  return FASTCYCLE_PYTHON;
}

void initialize() {
  const bool is_trusted = getauxval(AT_SECURE) == 0;  // Else setuid or similar.
  PyConfig config;
  PyConfig_InitPythonConfig(&config);
  config.parse_argv = 0;
  config.install_signal_handlers = 0;
  config.use_hash_seed = 1;
  config.hash_seed = 0;
  config.buffered_stdio = 0;
  if (!is_trusted) {
    config.use_environment = 0;
    config.user_site_directory = 0;
  }
  PyStatus status =
      PyConfig_SetBytesString(&config, &config.program_name, find_program(is_trusted).c_str());
  if (PyStatus_Exception(status) == 0) {
    status = Py_InitializeFromConfig(&config);
  }
  PyConfig_Clear(&config);
  if (PyStatus_Exception(status) != 0) {
    throw std::runtime_error(fmt::format("Python does not start: {}: {}",
                                         status.func == nullptr ? "?" : status.func,
                                         status.err_msg == nullptr ? "?" : status.err_msg));
  }
  PyEval_SaveThread();
}

/// Finds the package `fastcycle` if Python does not: in the build tree, and below another prefix
/// than Python's own.
void find_package() {
  const Gil gil;
  const fs::path libraries = host::core_library_folder();
  auto path = py::module_::import("sys").attr("path").cast<py::list>();
  for (const fs::path& folder :
       {libraries.parent_path() / "python", libraries / "python3/dist-packages"}) {
    std::error_code ignored;
    if (fs::exists(folder / "fastcycle/component.py", ignored)) {
      path.insert(0, folder.string());
      return;
    }
  }
}

/// The Python state of a foreign thread.
class Attachment {
 public:
  Attachment() {
    if (PyGILState_GetThisThreadState() == nullptr) {
      state_ = PyGILState_Ensure();
      is_ours_ = true;
      PyEval_SaveThread();
    }
  }
  Attachment(const Attachment&) = delete;
  Attachment& operator=(const Attachment&) = delete;
  ~Attachment() {
    if (is_ours_ && is_interpreter_there()) {
      static_cast<void>(PyGILState_Ensure());
      PyGILState_Release(PyGILState_LOCKED);
      PyGILState_Release(state_);
    }
  }

 private:
  PyGILState_STATE state_ = PyGILState_UNLOCKED;
  bool is_ours_ = false;
};

std::string text_of(const py::handle& object) {
  PyObject* const text = object ? PyObject_Str(object.ptr()) : nullptr;
  if (text == nullptr) {
    PyErr_Clear();
    return "?";
  }
  return py::reinterpret_steal<py::str>(text).cast<std::string>();
}

std::string file_name(const py::handle& path) {
  return fs::path(text_of(path)).filename().string();
}

/// "follower.py:31 in steer, from follower.py:12 in on_lane"; if there are many, the innermost.
std::string places_of(const py::handle& traceback) {
  constexpr std::size_t kMaxShown = 16;
  std::vector<std::string> places;
  for (py::object at = py::reinterpret_borrow<py::object>(traceback); at && !at.is_none();
       at = at.attr("tb_next")) {
    const py::object code = at.attr("tb_frame").attr("f_code");
    places.push_back(fmt::format("{}:{} in {}", file_name(code.attr("co_filename")),
                                 text_of(at.attr("tb_lineno")), text_of(code.attr("co_name"))));
  }
  std::string text;
  for (std::size_t i = places.size(); i > 0; --i) {
    if (places.size() - i == kMaxShown) {
      return text + fmt::format(", and {} more", i);
    }
    text += (text.empty() ? "" : ", from ") + places[i - 1];
  }
  return text;
}

std::string describe(const py::handle& type, const py::handle& value, const py::handle& traceback) {
  std::string name = text_of(py::getattr(type, "__name__", py::str("?")));
  if (PyErr_GivenExceptionMatches(type.ptr(), PyExc_SyntaxError) != 0 &&
      !py::getattr(value, "filename", py::none()).is_none()) {
    std::string line = text_of(py::getattr(value, "text", py::str("")));
    line.erase(0, line.find_first_not_of(" \t"));
    line.erase(line.find_last_not_of(" \r\n\t") + 1);
    return fmt::format("{}:{}: {}: {}, found `{}`", text_of(value.attr("filename")),
                       text_of(value.attr("lineno")), name, text_of(value.attr("msg")), line);
  }
  const std::string what = base::on_one_line(text_of(value));
  const std::string places = places_of(traceback);
  std::string text = name + (what.empty() ? "" : ": " + what);
  if (!places.empty()) {
    text += " (" + places + ")";
  }
  const py::object cause = py::getattr(value, "__cause__", py::none());
  if (!cause.is_none()) {
    text += "; because of " +
            describe(py::type::of(cause), cause, py::getattr(cause, "__traceback__", py::none()));
  }
  return text;
}

}  // namespace

void start_interpreter() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (Py_IsInitialized() == 0) {
      share_symbols();
      initialize();
    }
    find_package();
  });
}

bool is_interpreter_there() noexcept {
#if PY_VERSION_HEX < 0x030D0000  // In 3.13 it became public.
  const bool is_finalizing = _Py_IsFinalizing() != 0;
#else
  const bool is_finalizing = Py_IsFinalizing() != 0;
#endif
  return Py_IsInitialized() != 0 && !is_finalizing;
}

Gil::Gil() {
  static thread_local const Attachment attachment;
  static_cast<void>(attachment);
  state_ = PyGILState_Ensure();
}

std::string take_exception() {
  PyObject* type = nullptr;
  PyObject* value = nullptr;
  PyObject* traceback = nullptr;
  PyErr_Fetch(&type, &value, &traceback);
  PyErr_NormalizeException(&type, &value, &traceback);
  const auto its_type = py::reinterpret_steal<py::object>(type);
  const auto its_value = py::reinterpret_steal<py::object>(value);
  const auto its_traceback = py::reinterpret_steal<py::object>(traceback);
  try {
    return describe(its_type, its_value, its_traceback);
  } catch (const std::exception& exception) {
    return std::string("a Python exception that cannot be described: ") + exception.what();
  }
}

std::string in_words(py::error_already_set& error) {
  error.restore();
  return take_exception();
}

py::module_ import_file(const fs::path& file) {
  const fs::path whole = fs::weakly_canonical(file);
  const std::string folder = whole.parent_path().string();
  const auto sys = py::module_::import("sys");
  const auto modules = sys.attr("modules").cast<py::dict>();
  // Not its bare name: a file of that name in another folder is another module.
  const py::str name("fastcycle.components:" + whole.string());
  if (modules.contains(name)) {
    return modules[name].cast<py::module_>();
  }
  auto path = sys.attr("path").cast<py::list>();
  if (!path.contains(folder)) {
    path.insert(0, folder);
  }
  const auto util = py::module_::import("importlib.util");
  const py::object spec = util.attr("spec_from_file_location")(name, whole.string());
  const py::object module = util.attr("module_from_spec")(spec);
  modules[name] = module;
  try {
    spec.attr("loader").attr("exec_module")(module);
  } catch (py::error_already_set&) {
    PyDict_DelItem(modules.ptr(), name.ptr());
    PyErr_Clear();
    throw;
  }
  return module.cast<py::module_>();
}

}  // namespace fastcycle::python
