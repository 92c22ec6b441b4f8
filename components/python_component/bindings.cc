#include "bindings.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <pybind11/stl.h>

#include "component/component_core.h"
#include "message.h"
#include "python_component.h"

namespace py = pybind11;
namespace pb = google::protobuf;

namespace fastcycle::python {
namespace {

/// Refers to a component, as long as it exists.
class Owner {
 public:
  explicit Owner(PythonComponent& component) : component_(&component), link_(component.link()) {}

  PythonComponent& operator*() const {
    if (!link_->is_there) {
      throw std::runtime_error("the component that this belongs to is gone");
    }
    return *component_;
  }
  PythonComponent* operator->() const { return &**this; }

 private:
  PythonComponent* component_;
  std::shared_ptr<Link> link_;
};

Duration seconds(double value, const char* of) {
  if (!std::isfinite(value) || std::abs(value) > 9e9) {
    throw std::invalid_argument(fmt::format("{}: expected seconds, found {}", of, value));
  }
  return Duration(std::llround(value * 1e9));
}

std::optional<Duration> seconds(std::optional<double> value, const char* of) {
  return value ? std::optional(seconds(*value, of)) : std::nullopt;
}

std::int64_t nanoseconds(Time time) {
  return time.time_since_epoch().count();
}

// ---- Messages ----

struct Publisher {
  Owner owner;
  detail::PublisherCore& core;
  const pb::Descriptor& type;

  py::object loan() const {
    owner->check_in_call("loan()");
    return make_loan(core, owner->link());
  }

  void publish(const py::object& message, std::optional<std::int64_t> taken,
               const py::kwargs& fields) const {
    owner->check_in_call("publish()");
    PublishOptions options;
    if (taken) {
      options.taken_at = Time(Duration(*taken));
    }
    if (!message.is_none() && !fields.empty()) {
      throw std::invalid_argument("publish() takes a message, or fields by name, not both");
    }
    HandedMessage handed = hand_over(message, core, type);
    if (handed.kind == Handed::kReceived && !taken) {
      detail::publish_received(core, handed.envelope, handed.holder);
      return;
    }
    if (handed.kind != Handed::kLoan) {
      const py::object loan = make_loan(core, owner->link());
      fill(loan, message.is_none() ? py::handle(fields) : py::handle(message));
      handed = hand_over(loan, core, type);
    }
    detail::publish_loan(core, handed.envelope, options);
  }

  std::size_t subscriber_count() const {
    owner->check_in_call("subscriber_count");
    return detail::count_subscribers(core);
  }
};

struct Latest {
  Owner owner;
  detail::View& view;

  py::object get() const {
    owner->check_in_call("get()");
    const std::size_t size = detail::view_size(view);
    return size == 0 ? py::object(py::none())
                     : owner->lend(detail::view_at(view, size - 1), detail::view_holder(view));
  }
};

// ---- Timers ----

struct PyTimer {
  Owner owner;
  Timer timer;
  bool is_periodic;

  Timer& checked(const char* call, bool needs_period) {
    owner->check_in_call(call);
    if (needs_period != is_periodic) {
      throw std::runtime_error(
          fmt::format("{} of a timer that has {} period", call, is_periodic ? "a" : "no"));
    }
    return timer;
  }
};

// ---- Params ----

using AnyParam = std::variant<Param<bool>, Param<std::int64_t>, Param<double>, Param<std::string>,
                              Param<std::vector<bool>>, Param<std::vector<std::int64_t>>,
                              Param<std::vector<double>>, Param<std::vector<std::string>>>;

struct PyParam {
  Owner owner;
  AnyParam param;

  py::object get() const {
    static_cast<void>(*owner);
    return std::visit([](const auto& its) { return py::cast(its.get()); }, param);
  }
};

template <typename T>
std::optional<T> limit_of(const py::object& value) {
  return value.is_none() ? std::nullopt : std::optional(value.cast<T>());
}

struct ParamWords {
  py::object fallback;
  py::object min;
  py::object max;
  std::string unit;
  std::string description;
  bool is_tunable;
  py::object on_change;
};

template <typename T>
AnyParam declare(PythonComponent& component, const std::string& name, const ParamWords& words) {
  ParamOptions<T> options;
  using Element = typename ParamOptions<T>::Element;
  if (!words.fallback.is_none()) {
    options.fallback = words.fallback.cast<T>();
  }
  if constexpr (std::is_same_v<Element, double> || std::is_same_v<Element, std::int64_t>) {
    options.min = limit_of<Element>(words.min);
    options.max = limit_of<Element>(words.max);
  } else if (!words.min.is_none() || !words.max.is_none()) {
    throw std::invalid_argument(fmt::format("param \"{}\": only numbers have min and max", name));
  }
  options.unit = words.unit;
  options.description = words.description;
  options.is_tunable = words.is_tunable;
  Param<T> param = component.context().param<T>(name, std::move(options));
  if (!words.on_change.is_none()) {
    component.context().on_change(param, component.call_back(words.on_change));
  }
  return param;
}

template <typename T>
AnyParam declare_as(PythonComponent& component, const std::string& name, const ParamWords& words,
                    bool is_vector) {
  return is_vector ? declare<std::vector<T>>(component, name, words)
                   : declare<T>(component, name, words);
}

/// The type of a param: as given, or that of its fallback.
py::handle type_of(const std::string& name, const py::object& said, const py::object& fallback,
                   bool& is_vector) {
  py::handle type = said.is_none() ? py::handle(py::type::of(fallback)) : py::handle(said);
  py::object of = fallback;
  if (said.is_none() &&
      (py::isinstance<py::list>(fallback) || py::isinstance<py::tuple>(fallback))) {
    if (py::len(fallback) == 0) {
      throw std::invalid_argument(
          fmt::format("param \"{}\": of an empty list nobody knows the type: say type=list[float], "
                      "or list[int], list[str], list[bool]",
                      name));
    }
    is_vector = true;
    return py::type::of(fallback[py::int_(0)]);
  }
  const py::object origin = py::getattr(type, "__origin__", py::none());
  if (origin.is(py::handle(reinterpret_cast<PyObject*>(&PyList_Type)))) {
    is_vector = true;
    return type.attr("__args__")[py::int_(0)];
  }
  return type;
}

AnyParam declare_any(PythonComponent& component, const std::string& name, const py::object& said,
                     const ParamWords& words) {
  if (said.is_none() && words.fallback.is_none()) {
    throw std::invalid_argument(
        fmt::format("param \"{}\": expected a fallback, or type=float, found none of them", name));
  }
  bool is_vector = false;
  const py::handle type = type_of(name, said, words.fallback, is_vector);
  const auto is = [&](PyTypeObject& other) {
    return type.is(py::handle(reinterpret_cast<PyObject*>(&other)));
  };
  if (is(PyBool_Type)) {
    return declare_as<bool>(component, name, words, is_vector);
  }
  if (is(PyLong_Type)) {
    return declare_as<std::int64_t>(component, name, words, is_vector);
  }
  if (is(PyFloat_Type)) {
    return declare_as<double>(component, name, words, is_vector);
  }
  if (is(PyUnicode_Type)) {
    return declare_as<std::string>(component, name, words, is_vector);
  }
  throw std::invalid_argument(
      fmt::format("param \"{}\": expected the type bool, int, float, str or a list of one of them, "
                  "found {}",
                  name, py::str(type).cast<std::string>()));
}

// ---- The log ----

struct PyLog {
  Owner owner;

  template <LogLevel kLevel>
  void write(const std::string& text) const {
    const Log log = owner->log();
    if constexpr (kLevel == LogLevel::kDebug) {
      log.debug("{}", text);
    } else if constexpr (kLevel == LogLevel::kInfo) {
      log.info("{}", text);
    } else if constexpr (kLevel == LogLevel::kWarning) {
      log.warning("{}", text);
    } else {
      log.error("{}", text);
    }
  }
};

// ---- The context ----

struct PyContext {
  Owner owner;

  detail::ComponentCore& core() const { return owner->context().core(); }

  void subscribe(const std::string& topic, const std::string& type, const py::function& callback,
                 std::optional<std::size_t> depth, const std::optional<std::string>& overflow,
                 std::size_t keep, std::optional<std::size_t> history,
                 std::optional<double> lifespan) const {
    owner->check_constructing("subscribe()");
    SubscriberOptions options;
    options.depth = depth;
    options.keep = keep;
    options.history = history;
    options.lifespan = seconds(lifespan, "lifespan");
    if (overflow) {
      if (*overflow != "drop_oldest" && *overflow != "drop_newest") {
        throw std::invalid_argument(fmt::format(
            "overflow: expected \"drop_oldest\" or \"drop_newest\", found \"{}\"", *overflow));
      }
      options.overflow = *overflow == "drop_oldest" ? Overflow::kDropOldest : Overflow::kDropNewest;
    }
    const auto holder = std::make_shared<detail::Holder>(detail::kNobody);
    *holder = detail::holder_of(
        detail::create_subscription(core(), topic, owner->type_named(type), options,
                                    owner->call_back_with_message(callback, holder)));
  }

  Latest latest(const std::string& topic, const std::string& type) const {
    owner->check_constructing("latest()");
    return {owner, detail::create_view(core(), topic, owner->type_named(type), 1, std::nullopt)};
  }

  Publisher publisher(const std::string& topic, const std::string& type) const {
    owner->check_constructing("publisher()");
    const pb::Message& instance = owner->type_named(type);
    return {owner, detail::create_publisher(core(), topic, instance, nullptr, false),
            *instance.GetDescriptor()};
  }

  PyTimer timer(std::optional<double> period, const py::function& callback, double phase) const {
    owner->check_constructing("timer()");
    Context& context = owner->context();
    if (!period) {
      return {owner, context.create_timer(owner->call_back(callback)), false};
    }
    const Duration its_period = seconds(*period, "period");
    if (its_period <= Duration(0)) {
      throw std::invalid_argument(
          fmt::format("period: expected seconds above 0, found {}", *period));
    }
    return {owner,
            context.create_timer({.period = its_period, .phase = seconds(phase, "phase")},
                                 owner->call_back(callback)),
            true};
  }

  PyParam param(const std::string& name, const py::object& fallback, const py::object& type,
                const py::object& min, const py::object& max, const std::string& unit,
                const std::string& description, bool tunable, const py::object& on_change) const {
    owner->check_constructing("param()");
    return {owner, declare_any(*owner, name, type,
                               {fallback, min, max, unit, description, tunable, on_change})};
  }

  void health(const std::string& state, const std::string& reason) const {
    owner->check_in_call("health()");
    for (const auto& [word, value] :
         {std::pair("ok", Health::kOk), std::pair("degraded", Health::kDegraded),
          std::pair("failed", Health::kFailed)}) {
      if (state == word) {
        owner->health(value, reason);
        return;
      }
    }
    throw std::invalid_argument(
        fmt::format("health: expected \"ok\", \"degraded\" or \"failed\", found \"{}\"", state));
  }

  void switch_mode(const std::string& mode, const std::string& why) const {
    owner->check_in_call("switch_mode()");
    owner->context().switch_mode(mode, why);
  }

  py::object take_observed(const std::string& name) const {
    if (core().is_constructing) {
      throw std::runtime_error(
          "observe() in the constructor: observe in start(), which a "
          "recorded run has, and its constructor it has not");
    }
    const auto found = detail::take_observed(core(), name);
    return found ? py::object(py::str(*found)) : py::object(py::none());
  }

  void keep_observed(const std::string& name, const std::string& text) const {
    detail::keep_observed(core(), name, text);
  }

  void keep_failed_observation(const std::string& name, const std::string& what) const {
    try {
      throw std::runtime_error(what);
    } catch (const std::runtime_error&) {
      detail::keep_failed_observation(core(), name);
    }
  }

  static py::tuple info(const py::object& message) {
    const MessageInfo& info = message_info(message);
    return py::make_tuple(info.sequence, nanoseconds(info.publish_time),
                          nanoseconds(info.origin.taken), info.publisher);
  }
};

}  // namespace

void make_bindings() {
  static py::module_* made = nullptr;
  if (made != nullptr) {
    return;
  }
  static PyModuleDef definition{};
  auto module = py::module_::create_extension_module(
      "fastcycle._component", "What Python components are given.", &definition);

  py::class_<Publisher>(module, "Publisher")
      .def("loan", &Publisher::loan)
      .def("publish", &Publisher::publish, py::arg("message") = py::none(), py::pos_only(),
           py::kw_only(), py::arg("taken") = py::none())
      .def_property_readonly("subscriber_count", &Publisher::subscriber_count);
  py::class_<Latest>(module, "Latest").def("get", &Latest::get);
  py::class_<PyTimer>(module, "Timer")
      .def("reset", [](PyTimer& timer) { timer.checked("reset()", true).reset(); })
      .def("arm_in",
           [](PyTimer& timer, double delay) {
             timer.checked("arm_in()", false).arm_in(seconds(delay, "delay"));
           })
      .def("arm_at",
           [](PyTimer& timer, std::int64_t due) {
             timer.checked("arm_at()", false).arm_at(Time(Duration(due)));
           })
      .def("cancel", [](PyTimer& timer) { timer.checked("cancel()", timer.is_periodic).cancel(); });
  py::class_<PyParam>(module, "Param").def("get", &PyParam::get);
  py::class_<PyLog>(module, "Log")
      .def("debug", &PyLog::write<LogLevel::kDebug>)
      .def("info", &PyLog::write<LogLevel::kInfo>)
      .def("warning", &PyLog::write<LogLevel::kWarning>)
      .def("error", &PyLog::write<LogLevel::kError>);

  using py::arg;
  const py::none none;
  py::class_<PyContext>(module, "Context")
      .def_property_readonly(
          "component_name",
          [](const PyContext& context) { return context.owner->context().component_name(); })
      .def_property_readonly(
          "application_name",
          [](const PyContext& context) { return context.owner->context().application_name(); })
      .def_property_readonly("log", [](const PyContext& context) { return PyLog{context.owner}; })
      .def_property_readonly(
          "mode", [](const PyContext& context) { return context.owner->context().mode(); })
      .def("subscribe", &PyContext::subscribe, arg("topic"), arg("type"), arg("callback"),
           py::kw_only(), arg("depth") = none, arg("overflow") = none, arg("keep") = 0,
           arg("history") = none, arg("lifespan") = none)
      .def("latest", &PyContext::latest, arg("topic"), arg("type"))
      .def("publisher", &PyContext::publisher, arg("topic"), arg("type"))
      .def("timer", &PyContext::timer, arg("period"), arg("callback"), py::kw_only(),
           arg("phase") = 0.0)
      .def("param", &PyContext::param, arg("name"), arg("fallback") = none, py::kw_only(),
           arg("type") = none, arg("min") = none, arg("max") = none, arg("unit") = "",
           arg("description") = "", arg("tunable") = false, arg("on_change") = none)
      .def("now", [](const PyContext& context) { return nanoseconds(context.owner->now()); })
      .def("start_time",
           [](const PyContext& context) { return nanoseconds(context.owner->start_time()); })
      .def("report", [](const PyContext& context, const std::string& name,
                        const ReportValue& value) { context.owner->report(name, value); })
      .def("health", &PyContext::health, arg("state"), arg("reason") = "")
      .def("switch_mode", &PyContext::switch_mode, arg("mode"), arg("why") = "")
      .def("info",
           [](const PyContext&, const py::object& message) { return PyContext::info(message); })
      .def("random_bits", [](const PyContext& context) { return context.owner->random()(); })
      .def("take_observed", &PyContext::take_observed)
      .def("keep_observed", &PyContext::keep_observed)
      .def("keep_failed_observation", &PyContext::keep_failed_observation);
  py::module_::import("sys").attr("modules")["fastcycle._component"] = module;
  made = new py::module_(std::move(module));  // Lives as long as the interpreter.
}

py::object make_context(PythonComponent& component) {
  return py::cast(PyContext{Owner(component)});
}

}  // namespace fastcycle::python
