#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "archive/message_type.h"
#include "archive/overview.h"
#include "bench.h"
#include "columns.h"
#include "config/nearest.h"
#include "connection.h"
#include "fastcycle/version.h"
#include "field_path.h"
#include "mcap/error.h"
#include "not_found.h"
#include "recording.h"

// What the Python files of the package need of the library. Names, defaults and documentation of
// the public interface are theirs.
namespace fastcycle::python {
namespace {

namespace py = pybind11;

// ---- Errors ----

/// Raises `fastcycle.errors.NAME` with these arguments.
template <typename... Arguments>
void raise(const char* name, Arguments&&... arguments) {
  const py::object type = py::module_::import("fastcycle.errors").attr(name);
  const py::object error = type(std::forward<Arguments>(arguments)...);
  PyErr_SetObject(type.ptr(), error.ptr());
}

void translate(std::exception_ptr thrown) {
  try {
    std::rethrow_exception(std::move(thrown));
  } catch (const NotFound& error) {
    raise("NotFoundError", error.what());
  } catch (const mcap::Error& error) {
    raise("LogError", error.what());
  } catch (const inspect::ClientError& error) {
    raise("ApplicationError", error.what(), error.hint(), static_cast<int>(error.kind()));
  }
}

// ---- Logs ----

py::list channels_of(const Recording& recording) {
  py::list result;
  for (const auto& file : recording.files()) {
    const mcap::Reader& reader = file->reader;
    const auto& counts = reader.statistics()->channel_message_counts;
    for (const auto& [id, channel] : reader.definitions().channels()) {
      const mcap::Schema* const schema = reader.definitions().find_schema(channel.schema_id);
      const auto count = counts.find(id);
      result.append(py::make_tuple(channel.topic, channel.message_encoding,
                                   schema == nullptr ? "" : schema->name,
                                   py::bytes(schema == nullptr ? "" : schema->data),
                                   count == counts.end() ? 0 : count->second));
    }
  }
  return result;
}

/// The log times of the first and the last message; none if there is no message.
std::optional<std::pair<std::uint64_t, std::uint64_t>> range_of(const Recording& recording) {
  std::optional<std::pair<std::uint64_t, std::uint64_t>> range;
  for (const auto& file : recording.files()) {
    const mcap::Statistics& statistics = *file->reader.statistics();
    if (statistics.message_count == 0) {
      continue;
    }
    const std::pair own(statistics.message_start_time_ns, statistics.message_end_time_ns);
    range = range.value_or(own);
    range = std::pair(std::min(range->first, own.first), std::max(range->second, own.second));
  }
  return range;
}

std::vector<std::pair<std::string, std::map<std::string, std::string>>> metadata_of(
    const Recording& recording) {
  std::vector<std::pair<std::string, std::map<std::string, std::string>>> result;
  for (const auto& file : recording.files()) {
    for (const mcap::MetadataIndex& index : file->reader.metadata()) {
      mcap::Metadata metadata = file->reader.read(index);
      result.emplace_back(std::move(metadata.name), std::move(metadata.metadata));
    }
  }
  return result;
}

std::vector<std::string> problems_of(const Recording& recording) {
  std::vector<std::string> problems;
  for (const auto& file : recording.files()) {
    if (file->reader.problem()) {
      problems.push_back(mcap::to_string(*file->reader.problem()));
    }
  }
  return problems;
}

mcap::MessageQuery query_of(std::vector<std::string> topics, std::uint64_t begin_ns,
                            std::optional<std::uint64_t> end_ns) {
  return {.topics = std::move(topics), .begin_ns = begin_ns, .end_ns = end_ns};
}

py::object next_of(Cursor& cursor) {
  const mcap::StoredMessage* const message = cursor.next();
  if (message == nullptr) {
    return py::none();
  }
  const auto& metadata = message->channel->metadata;
  const auto publisher = metadata.find("publisher");
  return py::make_tuple(
      message->channel->topic, message->log_time_ns, message->publish_time_ns, message->sequence,
      publisher == metadata.end() ? "" : publisher->second,
      py::bytes(reinterpret_cast<const char*>(message->data.data()), message->data.size()));
}

template <typename T>
py::object array_of(const std::vector<T>& values, const Column& /*column*/) {
  return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::object array_of(const std::vector<std::uint8_t>& values, const Column& /*column*/) {
  return py::array(py::dtype::of<bool>(), values.size(), values.data());
}

/// An array of objects; None for what is missing.
py::object array_of(const std::vector<std::string>& values, const Column& column) {
  py::list list;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (column.missing[i] != 0) {
      list.append(py::none());
    } else if (column.kind == Column::Kind::kBytes) {
      list.append(py::bytes(values[i]));
    } else {
      list.append(py::reinterpret_steal<py::object>(PyUnicode_DecodeUTF8(
          values[i].data(), static_cast<py::ssize_t>(values[i].size()), "replace")));
    }
  }
  const py::object numpy = py::module_::import("numpy");
  py::object array = numpy.attr("empty")(values.size(), py::arg("dtype") = "object");
  array[py::slice(py::none(), py::none(), py::none())] = list;
  return array;
}

py::tuple table_of(const std::shared_ptr<const Recording>& recording, const std::string& topic,
                   const std::vector<std::string>& fields, std::uint64_t begin_ns,
                   std::optional<std::uint64_t> end_ns) {
  Table table;
  {
    const py::gil_scoped_release others_run;
    table = read_table(recording, query_of({topic}, begin_ns, end_ns), fields);
  }
  py::list columns;
  for (const Column& column : table.columns) {
    const py::object values =
        std::visit([&](const auto& all) { return array_of(all, column); }, column.values);
    const py::object missing =
        column.has_missing ? array_of(column.missing, column) : py::object(py::none());
    columns.append(py::make_tuple(values, missing, column.names));
  }
  return py::make_tuple(
      py::array_t<std::int64_t>(static_cast<py::ssize_t>(table.log_times_ns.size()),
                                table.log_times_ns.data()),
      columns);
}

std::vector<std::string> fields_of(const Recording& recording, const std::string& topic) {
  const archive::MessageType type(recording.schema_of(topic));
  return single_fields(type.descriptor());
}

void bind_logs(py::module_& module) {
  module.def("files_of_recording", &archive::files_of_recording);
  module.def("name_hint", &config::name_hint);

  py::class_<Recording, std::shared_ptr<Recording>>(module, "Recording")
      .def(py::init([](const std::vector<std::filesystem::path>& paths) {
        const py::gil_scoped_release others_run;
        return std::make_shared<Recording>(paths);
      }))
      .def_property_readonly("name", &Recording::name)
      .def("channels", &channels_of)
      .def("range", &range_of)
      .def("metadata", &metadata_of)
      .def("problems", &problems_of)
      .def("require_topic", &Recording::require_topic)
      .def("schema_of",
           [](const Recording& recording, const std::string& topic) {
             const mcap::Schema& schema = recording.schema_of(topic);
             return py::make_tuple(schema.name, py::bytes(schema.data));
           })
      .def("fields_of", &fields_of)
      .def(
          "most_elements",
          [](const std::shared_ptr<const Recording>& recording, const std::string& topic,
             const std::string& path, std::uint64_t begin_ns, std::optional<std::uint64_t> end_ns) {
            const py::gil_scoped_release others_run;
            return most_elements(recording, query_of({topic}, begin_ns, end_ns), path);
          })
      .def("table", [](const std::shared_ptr<Recording>& recording, const std::string& topic,
                       const std::vector<std::string>& fields, std::uint64_t begin_ns,
                       std::optional<std::uint64_t> end_ns) {
        return table_of(recording, topic, fields, begin_ns, end_ns);
      });

  py::class_<Cursor>(module, "Cursor")
      .def(py::init([](const std::shared_ptr<Recording>& recording, std::vector<std::string> topics,
                       std::uint64_t begin_ns, std::optional<std::uint64_t> end_ns) {
        return std::make_unique<Cursor>(recording, query_of(std::move(topics), begin_ns, end_ns));
      }))
      .def("next", &next_of);
}

// ---- Running applications ----

void bind_connections(py::module_& module) {
  module.def("find_application", [](const std::string& name) {
    const inspect::RunningApplication found = inspect::find_application(name);
    return py::make_tuple(found.name, found.pid, found.socket.string());
  });
  module.def("list_applications", [] {
    py::list result;
    for (const inspect::RunningApplication& running : inspect::list_applications()) {
      result.append(py::make_tuple(running.name, running.pid, running.socket.string()));
    }
    return result;
  });
  module.def("protocol_schema", [] { return py::bytes(protocol_schema()); });

  py::class_<Connection>(module, "Connection")
      .def(py::init<const std::string&, const std::string&>(),
           py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("welcome",
                             [](Connection& connection) { return py::bytes(connection.welcome()); })
      .def("post",
           [](Connection& connection, const std::string& request) {
             const py::gil_scoped_release others_run;
             return connection.post(request);
           })
      .def("take", [](Connection& connection, int patience_ms) -> py::object {
        std::optional<std::string> answer;
        {
          const py::gil_scoped_release others_run;
          answer = connection.take(std::chrono::milliseconds(patience_ms));
        }
        return answer ? py::object(py::bytes(*answer)) : py::object(py::none());
      });
}

// ---- The bench ----

Time time_of(std::int64_t ns) {
  return Time(Duration(ns));
}

/// The workers of a bench may be in Python, which they need to end.
struct DeleteWithoutGil {
  void operator()(Bench* bench) const {
    const py::gil_scoped_release others_run;
    delete bench;
  }
};

/// `handler` is none, or gives for the bytes of a request those of the reply, or a str with the
/// reason why there is none.
std::string add_service(Bench& bench, const std::string& service, const std::string& request,
                        const std::string& reply, const py::object& handler) {
  if (handler.is_none()) {
    return bench.add_service(service, request, reply, {});
  }
  // Whoever lets go of it last need not have the GIL.
  const std::shared_ptr<py::object> kept(new py::object(handler), [](py::object* object) {
    const py::gil_scoped_acquire gil;
    delete object;
  });
  return bench.add_service(service, request, reply, [kept](const std::string& bytes) {
    const py::gil_scoped_acquire gil;
    const py::object handled = (*kept)(py::bytes(bytes));
    return py::isinstance<py::bytes>(handled)
               ? Bench::Handled{handled.cast<std::string>(), {}}
               : Bench::Handled{std::nullopt, handled.cast<std::string>()};
  });
}

void bind_bench(py::module_& module) {
  module.def("schema_of_type",
             [](const std::string& type) { return py::bytes(schema_of_type(type)); });

  using Release = py::call_guard<py::gil_scoped_release>;
  py::class_<Bench, std::unique_ptr<Bench, DeleteWithoutGil>>(module, "Bench")
      .def(py::init<std::vector<std::filesystem::path>>())
      .def("add", &Bench::add)
      .def("configure", &Bench::configure)
      .def("add_input", &Bench::add_input)
      .def("add_output", &Bench::add_output)
      .def("start", &Bench::start, Release())
      .def("is_started", &Bench::is_started)
      .def(
          "advance", [](Bench& bench, std::int64_t ns) { bench.advance(Duration(ns)); }, Release())
      .def("stop", &Bench::stop, Release())
      .def("now", [](const Bench& bench) { return bench.now().time_since_epoch().count(); })
      .def("publish",
           [](Bench& bench, const std::string& input, const std::string& message,
              std::optional<std::int64_t> taken_ns) {
             const py::gil_scoped_release others_run;
             bench.publish(input, message,
                           taken_ns ? std::optional(time_of(*taken_ns)) : std::nullopt);
           })
      .def("take",
           [](Bench& bench, const std::string& output) {
             py::list result;
             for (const Bench::Received& one : bench.take(output)) {
               result.append(py::make_tuple(py::bytes(one.message), one.publish_time_ns,
                                            one.sequence, one.taken_ns));
             }
             return result;
           })
      .def("add_client", &Bench::add_client)
      .def("add_service", &add_service)
      .def("call",
           [](Bench& bench, const std::string& client, const std::string& request,
              std::optional<std::int64_t> deadline_ns) {
             const py::gil_scoped_release others_run;
             return bench.call(client, request,
                               deadline_ns ? std::optional(Duration(*deadline_ns)) : std::nullopt);
           })
      .def("answer_of",
           [](const Bench& bench, const std::string& client, std::size_t call) -> py::object {
             const auto answer = bench.answer_of(client, call);
             if (!answer) {
               return py::none();
             }
             return py::make_tuple(answer->status, answer->error, py::bytes(answer->reply));
           })
      .def("cancel", &Bench::cancel, Release())
      .def("take_requests",
           [](Bench& bench, const std::string& service) {
             py::list result;
             for (const auto& [index, request] : bench.take_requests(service)) {
               result.append(py::make_tuple(index, py::bytes(request)));
             }
             return result;
           })
      .def("answer", &Bench::answer, Release())
      .def("reject", &Bench::reject, Release())
      .def("change_params",
           [](Bench& bench, const std::vector<std::pair<std::string, std::string>>& pairs) {
             const py::gil_scoped_release others_run;
             std::vector<ParamChange> changes;
             for (const auto& [param, json] : pairs) {
               changes.push_back({.param = param, .json = json});
             }
             return bench.change_params(changes).errors;
           })
      .def("switch_mode", &Bench::switch_mode, Release())
      .def("mode", &Bench::mode)
      .def("activate", &Bench::activate, Release())
      .def("deactivate", &Bench::deactivate, Release())
      .def("is_active", &Bench::is_active)
      .def("results", &Bench::results)
      .def("faults", &Bench::faults);
}

}  // namespace

PYBIND11_MODULE(_fastcycle, module) {
  module.attr("version") = FASTCYCLE_VERSION;
  py::register_exception_translator(&translate);
  bind_logs(module);
  bind_connections(module);
  bind_bench(module);
}

}  // namespace fastcycle::python
