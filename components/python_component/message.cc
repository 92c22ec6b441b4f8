#include "message.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/reflection.h>
#include <pybind11/numpy.h>

#include "config/nearest.h"
#include "interpreter.h"

// The types use Python's C API, and not pybind11: a field is read in 0.1 µs.

namespace py = pybind11;
namespace pb = google::protobuf;

namespace fastcycle::python {
namespace {

using pb::FieldDescriptor;
using CppType = FieldDescriptor::CppType;

// ---- Message types ----

struct TypeInfo {
  explicit TypeInfo(const pb::Descriptor& its_type) : type(its_type) {
    for (int i = 0; i < type.field_count(); ++i) {
      places[py::str(type.field(i)->name())] = py::int_(i);
    }
  }

  const pb::Descriptor& type;
  py::dict places;  ///< Field name → its index.
};

/// Never freed: it holds Python objects, and lives as long as the interpreter.
TypeInfo& info_of(const pb::Descriptor& type) {
  static auto& all = *new std::unordered_map<const pb::Descriptor*, std::unique_ptr<TypeInfo>>;
  auto& found = all[&type];
  if (found == nullptr) {
    found = std::make_unique<TypeInfo>(type);
  }
  return *found;
}

/// The members of an enumeration, from Python's `enum.IntEnum`, by number.
const py::dict& members_of(const pb::EnumDescriptor& type) {
  static auto& all = *new std::unordered_map<const pb::EnumDescriptor*, py::dict>;
  const auto [entry, is_new] = all.try_emplace(&type);
  if (is_new) {
    py::dict names;
    for (int i = 0; i < type.value_count(); ++i) {
      names[py::str(type.value(i)->name())] = py::int_(type.value(i)->number());
    }
    const py::object made = py::module_::import("enum").attr("IntEnum")(type.name(), names);
    for (const py::handle member : made) {
      entry->second[py::int_(member.attr("value"))] = member;
    }
  }
  return entry->second;
}

bool is_number(const FieldDescriptor& field) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_STRING:
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return false;
    default:
      return true;
  }
}

/// The memory of a repeated field. Protobuf's alternative returns single values.
template <typename T>
pb::RepeatedField<T>& memory_of(pb::Message& message, const FieldDescriptor& field) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
  return *message.GetReflection()->MutableRepeatedField<T>(&message, &field);
#pragma GCC diagnostic pop
}

// ---- The Python objects ----

/// A message, or a part of one.
struct MessageObject {
  PyObject_HEAD Shared* shared;
  std::uint64_t generation;  ///< Of the loan, at construction.
  pb::Message* message;      ///< Of a received one it is const.
  TypeInfo* info;
};

/// A repeated field of messages.
struct SequenceObject {
  PyObject_HEAD Shared* shared;
  std::uint64_t generation;
  pb::Message* message;
  const FieldDescriptor* field;
};

/// Bytes of a received message, viewed by a memoryview.
struct BytesObject {
  PyObject_HEAD Shared* shared;
  const std::string* bytes;
};

PyTypeObject* message_type = nullptr;
PyTypeObject* loan_type = nullptr;
PyTypeObject* sequence_type = nullptr;
PyTypeObject* loan_sequence_type = nullptr;
PyTypeObject* bytes_type = nullptr;
bool has_numpy = false;

void let_go(Shared* shared) noexcept {
  if (--shared->count > 0) {
    return;
  }
  if (shared->envelope != nullptr) {
    if (shared->publisher != nullptr) {
      if (shared->link->is_there) {
        detail::return_loan(*shared->publisher, shared->envelope);
      }
    } else {
      if (shared->is_kept) {
        detail::let_go(*shared->envelope, shared->holder);
      }
      detail::release(shared->envelope);
    }
  }
  delete shared;
}

template <typename T>
T* make(PyTypeObject* type, Shared* shared) {
  T* const made = PyObject_New(T, type);
  if (made == nullptr) {
    throw py::error_already_set();
  }
  ++shared->count;
  made->shared = shared;
  if constexpr (requires { made->generation; }) {
    made->generation = shared->generation;
  }
  return made;
}

template <typename T>
void destroy(PyObject* self) {
  PyTypeObject* const type = Py_TYPE(self);
  let_go(reinterpret_cast<T*>(self)->shared);
  PyObject_Free(self);
  Py_DECREF(type);
}

bool is_loan(const Shared& shared) {
  return shared.publisher != nullptr;
}

[[noreturn]] void fail(PyObject* kind, const std::string& what) {
  PyErr_SetString(kind, what.c_str());
  throw py::error_already_set();
}

/// After a loan was published, others may read it.
void check_there(const Shared& shared) {
  if (shared.envelope == nullptr) {
    fail(PyExc_RuntimeError, "the message was published: ask the publisher for another loan()");
  }
  if (is_loan(shared) && !shared.link->is_there) {
    fail(PyExc_RuntimeError, "the message was lent to a component that is gone");
  }
}

/// The same for an object that may be a part of it.
template <typename T>
void check(const T& object) {
  const Shared& shared = *object.shared;
  check_there(shared);
  if (is_loan(shared) && object.message != shared.envelope->own &&
      object.generation != shared.generation) {
    fail(PyExc_RuntimeError,
         "this part of the message may be gone, since a part was replaced: ask for it again");
  }
}

/// Runs `body`, and converts its exceptions to Python's.
template <typename R, typename F>
R guarded(R on_error, F body) noexcept {
  try {
    return body();
  } catch (py::error_already_set& error) {
    error.restore();
  } catch (const std::exception& exception) {
    PyErr_SetString(PyExc_RuntimeError, exception.what());
  }
  return on_error;
}

PyObject* new_message(Shared* shared, const pb::Message& message) {
  auto* const made = make<MessageObject>(is_loan(*shared) ? loan_type : message_type, shared);
  made->message = const_cast<pb::Message*>(&message);
  made->info = &info_of(*message.GetDescriptor());
  return reinterpret_cast<PyObject*>(made);
}

// ---- Fields to Python ----

std::string full_name(const FieldDescriptor& field) {
  return field.full_name();
}

py::object enum_of(const FieldDescriptor& field, int number) {
  const py::dict& members = members_of(*field.enum_type());
  const py::int_ key(number);
  PyObject* const found = PyDict_GetItemWithError(members.ptr(), key.ptr());
  return found == nullptr ? py::object(key) : py::reinterpret_borrow<py::object>(found);
}

py::object text_of(const std::string& text) {
  PyObject* const made =
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace");
  if (made == nullptr) {
    throw py::error_already_set();
  }
  return py::reinterpret_steal<py::object>(made);
}

/// For a received message a memoryview that keeps it alive; for a loan, which may still change, a
/// copy.
py::object bytes_of(Shared* shared, const std::string& bytes) {
  if (is_loan(*shared)) {
    return py::bytes(bytes);
  }
  auto* const exporter = make<BytesObject>(bytes_type, shared);
  exporter->bytes = &bytes;
  const auto owned = py::reinterpret_steal<py::object>(reinterpret_cast<PyObject*>(exporter));
  PyObject* const view = PyMemoryView_FromObject(owned.ptr());
  if (view == nullptr) {
    throw py::error_already_set();
  }
  return py::reinterpret_steal<py::object>(view);
}

template <typename T>
py::object numbers_of(PyObject* self, const pb::Message& message, const FieldDescriptor& field) {
  const auto& numbers = memory_of<T>(const_cast<pb::Message&>(message), field);
  const bool is_copy = is_loan(*reinterpret_cast<MessageObject*>(self)->shared);
  if (!has_numpy) {
    py::tuple made(static_cast<std::size_t>(numbers.size()));
    for (int i = 0; i < numbers.size(); ++i) {
      made[static_cast<std::size_t>(i)] = numbers.Get(i);
    }
    return made;
  }
  // With a base it refers to the message's memory, which the base keeps alive; without, it copies.
  const py::array_t<T> made(static_cast<py::ssize_t>(numbers.size()), numbers.data(),
                            is_copy ? py::handle() : py::handle(self));
  py::detail::array_proxy(made.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return made;
}

py::object single_of(Shared* shared, const pb::Message& message, const FieldDescriptor& field) {
  const pb::Reflection& reflection = *message.GetReflection();
  std::string scratch;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return py::float_(reflection.GetDouble(message, &field));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return py::float_(static_cast<double>(reflection.GetFloat(message, &field)));
    case FieldDescriptor::CPPTYPE_INT32:
      return py::int_(reflection.GetInt32(message, &field));
    case FieldDescriptor::CPPTYPE_INT64:
      return py::int_(reflection.GetInt64(message, &field));
    case FieldDescriptor::CPPTYPE_UINT32:
      return py::int_(reflection.GetUInt32(message, &field));
    case FieldDescriptor::CPPTYPE_UINT64:
      return py::int_(reflection.GetUInt64(message, &field));
    case FieldDescriptor::CPPTYPE_BOOL:
      return py::bool_(reflection.GetBool(message, &field));
    case FieldDescriptor::CPPTYPE_ENUM:
      return enum_of(field, reflection.GetEnumValue(message, &field));
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string& text = reflection.GetStringReference(message, &field, &scratch);
      return field.type() == FieldDescriptor::TYPE_BYTES ? bytes_of(shared, text) : text_of(text);
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  const pb::Message& part =
      is_loan(*shared) ? *reflection.MutableMessage(const_cast<pb::Message*>(&message), &field)
                       : reflection.GetMessage(message, &field);
  return py::reinterpret_steal<py::object>(new_message(shared, part));
}

/// A dict sorted by keys, independent of the map's order.
py::object map_of(Shared* shared, const pb::Message& message, const FieldDescriptor& field) {
  const pb::Reflection& reflection = *message.GetReflection();
  const FieldDescriptor& key = *field.message_type()->map_key();
  const FieldDescriptor& value = *field.message_type()->map_value();
  if (is_loan(*shared) && value.message_type() != nullptr) {
    fail(PyExc_TypeError, full_name(field) + " of a loan is not read: assign a dict to it");
  }
  py::list entries;
  for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
    const pb::Message& entry = reflection.GetRepeatedMessage(message, &field, i);
    entries.append(py::make_tuple(single_of(shared, entry, key), single_of(shared, entry, value)));
  }
  entries.attr("sort")(py::arg("key") =
                           py::module_::import("operator").attr("itemgetter")(py::int_(0)));
  py::dict made;
  for (const py::handle entry : entries) {
    made[entry[py::int_(0)]] = entry[py::int_(1)];
  }
  return made;
}

py::object repeated_of(PyObject* self, const pb::Message& message, const FieldDescriptor& field) {
  Shared* const shared = reinterpret_cast<MessageObject*>(self)->shared;
  const pb::Reflection& reflection = *message.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return numbers_of<double>(self, message, field);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return numbers_of<float>(self, message, field);
    case FieldDescriptor::CPPTYPE_INT32:
    case FieldDescriptor::CPPTYPE_ENUM:
      return numbers_of<std::int32_t>(self, message, field);
    case FieldDescriptor::CPPTYPE_INT64:
      return numbers_of<std::int64_t>(self, message, field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return numbers_of<std::uint32_t>(self, message, field);
    case FieldDescriptor::CPPTYPE_UINT64:
      return numbers_of<std::uint64_t>(self, message, field);
    case FieldDescriptor::CPPTYPE_BOOL:
      return numbers_of<bool>(self, message, field);
    case FieldDescriptor::CPPTYPE_STRING: {
      const int size = reflection.FieldSize(message, &field);
      py::tuple made(static_cast<std::size_t>(size));
      std::string scratch;
      for (int i = 0; i < size; ++i) {
        const std::string& text =
            reflection.GetRepeatedStringReference(message, &field, i, &scratch);
        made[static_cast<std::size_t>(i)] =
            field.type() == FieldDescriptor::TYPE_BYTES ? bytes_of(shared, text) : text_of(text);
      }
      return made;
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  auto* const made =
      make<SequenceObject>(is_loan(*shared) ? loan_sequence_type : sequence_type, shared);
  made->message = const_cast<pb::Message*>(&message);
  made->field = &field;
  return py::reinterpret_steal<py::object>(reinterpret_cast<PyObject*>(made));
}

// ---- Fields from Python ----

void fill_message(pb::Message& message, const py::handle& value);

[[noreturn]] void refuse(const FieldDescriptor& field, const char* expected,
                         const py::handle& found, PyObject* kind = PyExc_TypeError) {
  PyErr_Clear();
  const std::string repr = py::repr(found).cast<std::string>();
  fail(kind, fmt::format("{}: expected {}, found {} {}", full_name(field), expected,
                         Py_TYPE(found.ptr())->tp_name, repr.substr(0, 60)));
}

double to_double(const FieldDescriptor& field, const py::handle& value) {
  const double number = PyFloat_AsDouble(value.ptr());
  if (number == -1.0 && PyErr_Occurred() != nullptr) {
    refuse(field, "a number", value);
  }
  return number;
}

template <typename T>
T to_integer(const FieldDescriptor& field, const py::handle& value) {
  const auto index = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
  if (!index) {
    refuse(field, "an integer", value);
  }
  const std::string range = fmt::format("an integer in [{}, {}]", std::numeric_limits<T>::min(),
                                        std::numeric_limits<T>::max());
  if constexpr (std::is_signed_v<T>) {
    const long long number = PyLong_AsLongLong(index.ptr());
    if ((number == -1 && PyErr_Occurred() != nullptr) || number < std::numeric_limits<T>::min() ||
        number > std::numeric_limits<T>::max()) {
      refuse(field, range.c_str(), value, PyExc_ValueError);
    }
    return static_cast<T>(number);
  } else {
    const unsigned long long number = PyLong_AsUnsignedLongLong(index.ptr());
    if ((number == static_cast<unsigned long long>(-1) && PyErr_Occurred() != nullptr) ||
        number > std::numeric_limits<T>::max()) {
      refuse(field, range.c_str(), value, PyExc_ValueError);
    }
    return static_cast<T>(number);
  }
}

bool to_bool(const FieldDescriptor& field, const py::handle& value) {
  const int truth = PyBool_Check(value.ptr()) || PyIndex_Check(value.ptr()) ||
                            std::strcmp(Py_TYPE(value.ptr())->tp_name, "numpy.bool_") == 0
                        ? PyObject_IsTrue(value.ptr())
                        : -1;
  if (truth < 0) {
    refuse(field, "a bool", value);
  }
  return truth != 0;
}

int to_enum(const FieldDescriptor& field, const py::handle& value) {
  if (PyUnicode_Check(value.ptr())) {
    const std::string name = value.cast<std::string>();
    const pb::EnumValueDescriptor* const found = field.enum_type()->FindValueByName(name);
    if (found != nullptr) {
      return found->number();
    }
    std::vector<std::string> known;
    for (int i = 0; i < field.enum_type()->value_count(); ++i) {
      known.push_back(field.enum_type()->value(i)->name());
    }
    fail(PyExc_ValueError,
         fmt::format("{}: there is no {} \"{}\"; {}", full_name(field),
                     field.enum_type()->full_name(), name, config::name_hint(name, known)));
  }
  return to_integer<std::int32_t>(field, value);
}

std::string to_string(const FieldDescriptor& field, const py::handle& value) {
  if (field.type() == FieldDescriptor::TYPE_STRING) {
    Py_ssize_t size = 0;
    const char* const text =
        PyUnicode_Check(value.ptr()) ? PyUnicode_AsUTF8AndSize(value.ptr(), &size) : nullptr;
    if (text == nullptr) {
      refuse(field, "a str", value);
    }
    return {text, static_cast<std::size_t>(size)};
  }
  Py_buffer buffer{};
  if (PyUnicode_Check(value.ptr()) ||
      PyObject_GetBuffer(value.ptr(), &buffer, PyBUF_C_CONTIGUOUS) != 0) {
    refuse(field, "bytes, or a contiguous array", value);
  }
  std::string bytes(static_cast<const char*>(buffer.buf), static_cast<std::size_t>(buffer.len));
  PyBuffer_Release(&buffer);
  return bytes;
}

/// Copies an array of exactly this number type at once; false if `value` is not one.
template <typename T>
bool copy_array(pb::RepeatedField<T>& numbers, const py::handle& value) {
  Py_buffer buffer{};
  if (PyObject_CheckBuffer(value.ptr()) == 0 ||
      PyObject_GetBuffer(value.ptr(), &buffer, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) != 0) {
    PyErr_Clear();
    return false;
  }
  const std::string format = buffer.format == nullptr ? "B" : buffer.format;
  const std::string ours = py::format_descriptor<T>::format();
  const bool is_same =
      buffer.ndim == 1 && buffer.itemsize == static_cast<Py_ssize_t>(sizeof(T)) &&
      (format == ours || (std::is_same_v<T, std::int64_t> && (format == "l" || format == "q")) ||
       (std::is_same_v<T, std::uint64_t> && (format == "L" || format == "Q")));
  if (is_same) {
    numbers.Resize(static_cast<int>(buffer.len / buffer.itemsize), T{});
    std::memcpy(numbers.mutable_data(), buffer.buf, static_cast<std::size_t>(buffer.len));
  }
  PyBuffer_Release(&buffer);
  return is_same;
}

template <typename T, typename F>
void set_numbers(pb::Message& message, const FieldDescriptor& field, const py::handle& value,
                 F convert) {
  auto& numbers = memory_of<T>(message, field);
  if (field.cpp_type() != FieldDescriptor::CPPTYPE_ENUM && copy_array(numbers, value)) {
    return;
  }
  if (PyUnicode_Check(value.ptr())) {
    refuse(field, "a sequence of numbers", value);
  }
  numbers.Clear();
  const auto items = py::reinterpret_steal<py::object>(PyObject_GetIter(value.ptr()));
  if (!items) {
    refuse(field, "a sequence of numbers", value);
  }
  while (const auto item = py::reinterpret_steal<py::object>(PyIter_Next(items.ptr()))) {
    numbers.Add(static_cast<T>(convert(field, item)));
  }
  if (PyErr_Occurred() != nullptr) {
    throw py::error_already_set();
  }
}

void set_single(pb::Message& message, const FieldDescriptor& field, const py::handle& value) {
  const pb::Reflection& reflection = *message.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return reflection.SetDouble(&message, &field, to_double(field, value));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return reflection.SetFloat(&message, &field, static_cast<float>(to_double(field, value)));
    case FieldDescriptor::CPPTYPE_INT32:
      return reflection.SetInt32(&message, &field, to_integer<std::int32_t>(field, value));
    case FieldDescriptor::CPPTYPE_INT64:
      return reflection.SetInt64(&message, &field, to_integer<std::int64_t>(field, value));
    case FieldDescriptor::CPPTYPE_UINT32:
      return reflection.SetUInt32(&message, &field, to_integer<std::uint32_t>(field, value));
    case FieldDescriptor::CPPTYPE_UINT64:
      return reflection.SetUInt64(&message, &field, to_integer<std::uint64_t>(field, value));
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.SetBool(&message, &field, to_bool(field, value));
    case FieldDescriptor::CPPTYPE_ENUM:
      return reflection.SetEnumValue(&message, &field, to_enum(field, value));
    case FieldDescriptor::CPPTYPE_STRING:
      return reflection.SetString(&message, &field, to_string(field, value));
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  // The value may be a part of what it replaces.
  const std::unique_ptr<pb::Message> made(reflection.GetMessage(message, &field).New());
  fill_message(*made, value);
  pb::Message& part = *reflection.MutableMessage(&message, &field);
  part.GetReflection()->Swap(&part, made.get());
}

void set_map(pb::Message& message, const FieldDescriptor& field, const py::handle& value) {
  if (!py::isinstance<py::dict>(value)) {
    refuse(field, "a dict", value);
  }
  const pb::Reflection& reflection = *message.GetReflection();
  reflection.ClearField(&message, &field);
  for (const auto& [key, item] : py::reinterpret_borrow<py::dict>(value)) {
    pb::Message& entry = *reflection.AddMessage(&message, &field);
    set_single(entry, *field.message_type()->map_key(), key);
    set_single(entry, *field.message_type()->map_value(), item);
  }
}

void set_repeated(pb::Message& message, const FieldDescriptor& field, const py::handle& value) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return set_numbers<double>(message, field, value, to_double);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return set_numbers<float>(message, field, value, to_double);
    case FieldDescriptor::CPPTYPE_INT32:
      return set_numbers<std::int32_t>(message, field, value, to_integer<std::int32_t>);
    case FieldDescriptor::CPPTYPE_ENUM:
      return set_numbers<std::int32_t>(message, field, value, to_enum);
    case FieldDescriptor::CPPTYPE_INT64:
      return set_numbers<std::int64_t>(message, field, value, to_integer<std::int64_t>);
    case FieldDescriptor::CPPTYPE_UINT32:
      return set_numbers<std::uint32_t>(message, field, value, to_integer<std::uint32_t>);
    case FieldDescriptor::CPPTYPE_UINT64:
      return set_numbers<std::uint64_t>(message, field, value, to_integer<std::uint64_t>);
    case FieldDescriptor::CPPTYPE_BOOL:
      return set_numbers<bool>(message, field, value, to_bool);
    default:
      break;
  }
  const auto items = py::reinterpret_steal<py::object>(
      PyUnicode_Check(value.ptr()) || PyBytes_Check(value.ptr()) ? nullptr
                                                                 : PyObject_GetIter(value.ptr()));
  if (!items) {
    refuse(field, "a sequence", value);
  }
  // Perhaps of itself: so all of it is copied before anything is cleared.
  const py::list all(items);
  const pb::Reflection& reflection = *message.GetReflection();
  std::unique_ptr<pb::Message> made(message.New());
  for (const py::handle item : all) {
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
      reflection.AddString(made.get(), &field, to_string(field, item));
    } else {
      fill_message(*reflection.AddMessage(made.get(), &field), item);
    }
  }
  reflection.ClearField(&message, &field);
  reflection.SwapFields(&message, made.get(), {&field});
}

void set_field(pb::Message& message, const FieldDescriptor& field, const py::handle& value) {
  if (field.is_map()) {
    set_map(message, field, value);
  } else if (field.is_repeated()) {
    set_repeated(message, field, value);
  } else {
    set_single(message, field, value);
  }
}

[[noreturn]] void refuse_name(const pb::Descriptor& type, const std::string& name, PyObject* kind) {
  std::vector<std::string> known;
  for (int i = 0; i < type.field_count(); ++i) {
    known.push_back(type.field(i)->name());
  }
  fail(kind, fmt::format("{} has no field \"{}\"; {}", type.full_name(), name,
                         config::name_hint(name, known)));
}

const FieldDescriptor* find_field(const TypeInfo& info, PyObject* name) {
  PyObject* const place = PyDict_GetItemWithError(info.places.ptr(), name);
  return place == nullptr ? nullptr : info.type.field(static_cast<int>(PyLong_AsLong(place)));
}

const FieldDescriptor& field_named(const TypeInfo& info, py::handle name, PyObject* kind) {
  const FieldDescriptor* const found =
      PyUnicode_Check(name.ptr()) ? find_field(info, name.ptr()) : nullptr;
  if (found == nullptr) {
    refuse_name(info.type, py::str(name).cast<std::string>(), kind);
  }
  return *found;
}

MessageObject* as_message(const py::handle& object) {
  return Py_TYPE(object.ptr()) == message_type || Py_TYPE(object.ptr()) == loan_type
             ? reinterpret_cast<MessageObject*>(object.ptr())
             : nullptr;
}

/// Fills an empty message.
void fill_message(pb::Message& message, const py::handle& value) {
  const pb::Descriptor& type = *message.GetDescriptor();
  if (const MessageObject* const other = as_message(value)) {
    check(*other);
    if (&other->info->type != &type) {
      fail(PyExc_TypeError, fmt::format("expected a message {}, found one {}", type.full_name(),
                                        other->info->type.full_name()));
    }
    message.CopyFrom(*other->message);
    return;
  }
  if (!py::isinstance<py::dict>(value)) {
    fail(PyExc_TypeError, fmt::format("expected a {}: a dict, or such a message, found {}",
                                      type.full_name(), Py_TYPE(value.ptr())->tp_name));
  }
  const TypeInfo& info = info_of(type);
  for (const auto& [name, item] : py::reinterpret_borrow<py::dict>(value)) {
    set_field(message, field_named(info, name, PyExc_ValueError), item);
  }
}

// ---- Called by Python ----

PyObject* get_attribute(PyObject* self, PyObject* name) {
  return guarded<PyObject*>(nullptr, [&]() -> PyObject* {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    const FieldDescriptor* const field = find_field(*object.info, name);
    if (field == nullptr) {
      PyObject* const found = PyObject_GenericGetAttr(self, name);
      if (found == nullptr && PyErr_ExceptionMatches(PyExc_AttributeError) != 0) {
        const std::string text = py::str(name).cast<std::string>();
        if (!text.starts_with("_")) {
          PyErr_Clear();
          refuse_name(object.info->type, text, PyExc_AttributeError);
        }
      }
      return found;
    }
    check(object);
    if (field->is_map()) {
      return map_of(object.shared, *object.message, *field).release().ptr();
    }
    if (field->is_repeated()) {
      return repeated_of(self, *object.message, *field).release().ptr();
    }
    return single_of(object.shared, *object.message, *field).release().ptr();
  });
}

int set_attribute(PyObject* self, PyObject* name, PyObject* value) {
  return guarded(-1, [&] {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    const FieldDescriptor& field = field_named(*object.info, name, PyExc_AttributeError);
    if (!is_loan(*object.shared)) {
      fail(PyExc_AttributeError,
           fmt::format("{} of a received message cannot be changed: others read it too",
                       full_name(field)));
    }
    check(object);
    if (value == nullptr) {
      object.message->GetReflection()->ClearField(object.message, &field);
    } else {
      set_field(*object.message, field, value);
    }
    if (field.message_type() != nullptr || field.real_containing_oneof() != nullptr) {
      ++object.shared->generation;
    }
    return 0;
  });
}

PyObject* text_of_message(PyObject* self) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    check(object);
    return py::str(object.info->type.full_name() + " {" + object.message->ShortDebugString() + "}")
        .release()
        .ptr();
  });
}

PyObject* has_field(PyObject* self, PyObject* name) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    check(object);
    const FieldDescriptor& field = field_named(*object.info, name, PyExc_ValueError);
    if (!field.has_presence()) {
      fail(PyExc_ValueError,
           fmt::format("{} has no presence: it always has a value", full_name(field)));
    }
    return py::bool_(object.message->GetReflection()->HasField(*object.message, &field))
        .release()
        .ptr();
  });
}

PyObject* serialize(PyObject* self, PyObject*) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    check(object);
    return py::bytes(object.message->SerializeAsString()).release().ptr();
  });
}

PyObject* copy_from(PyObject* self, PyObject* value) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    check(object);
    std::unique_ptr<pb::Message> made(object.message->New());
    fill_message(*made, value);
    object.message->GetReflection()->Swap(object.message, made.get());
    ++object.shared->generation;
    Py_RETURN_NONE;
  });
}

PyObject* clear(PyObject* self, PyObject*) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<MessageObject*>(self);
    check(object);
    object.message->Clear();
    ++object.shared->generation;
    Py_RETURN_NONE;
  });
}

// ---- Repeated messages ----

Py_ssize_t size_of(PyObject* self) {
  const auto& object = *reinterpret_cast<SequenceObject*>(self);
  return guarded<Py_ssize_t>(-1, [&] {
    check(object);
    return static_cast<Py_ssize_t>(
        object.message->GetReflection()->FieldSize(*object.message, object.field));
  });
}

PyObject* item_of(PyObject* self, Py_ssize_t index) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<SequenceObject*>(self);
    check(object);
    const pb::Reflection& reflection = *object.message->GetReflection();
    const int size = reflection.FieldSize(*object.message, object.field);
    if (index < 0 || index >= size) {
      fail(PyExc_IndexError, fmt::format("{} has {} items, and none with the index {}",
                                         full_name(*object.field), size, index));
    }
    return new_message(object.shared, reflection.GetRepeatedMessage(*object.message, object.field,
                                                                    static_cast<int>(index)));
  });
}

PyObject* add_item(PyObject* self, PyObject* positional, PyObject* named) {
  return guarded<PyObject*>(nullptr, [&]() -> PyObject* {
    const auto& object = *reinterpret_cast<SequenceObject*>(self);
    check(object);
    const Py_ssize_t count = PyTuple_GET_SIZE(positional);
    if (count > 1 || (count == 1 && named != nullptr)) {
      fail(PyExc_TypeError, "add() takes one message or dict, or fields by name");
    }
    const pb::Reflection& reflection = *object.message->GetReflection();
    std::unique_ptr<pb::Message> made(
        pb::MessageFactory::generated_factory()->GetPrototype(object.field->message_type())->New());
    if (count == 1) {
      fill_message(*made, PyTuple_GET_ITEM(positional, 0));
    } else if (named != nullptr) {
      fill_message(*made, named);
    }
    pb::Message& added = *reflection.AddMessage(object.message, object.field);
    added.GetReflection()->Swap(&added, made.get());
    return new_message(object.shared, added);
  });
}

PyObject* clear_items(PyObject* self, PyObject*) {
  return guarded<PyObject*>(nullptr, [&] {
    const auto& object = *reinterpret_cast<SequenceObject*>(self);
    check(object);
    object.message->GetReflection()->ClearField(object.message, object.field);
    ++object.shared->generation;
    Py_RETURN_NONE;
  });
}

// ---- Bytes ----

int get_buffer(PyObject* self, Py_buffer* buffer, int flags) {
  const std::string& bytes = *reinterpret_cast<BytesObject*>(self)->bytes;
  return PyBuffer_FillInfo(buffer, self, const_cast<char*>(bytes.data()),
                           static_cast<Py_ssize_t>(bytes.size()), 1, flags);
}

// ---- Their types ----

template <typename F>
void* slot(F* function) {
  return reinterpret_cast<void*>(function);
}

PyMethodDef message_methods[] = {
    {"HasField", &has_field, METH_O, "Whether a field that may be absent is there."},
    {"SerializeToString", &serialize, METH_NOARGS, "The message as protobuf's bytes."},
    {nullptr, nullptr, 0, nullptr}};
PyMethodDef loan_methods[] = {
    {"HasField", &has_field, METH_O, "Whether a field that may be absent is there."},
    {"SerializeToString", &serialize, METH_NOARGS, "The message as protobuf's bytes."},
    {"CopyFrom", &copy_from, METH_O, "Takes over all of a dict or a message of the same type."},
    {"Clear", &clear, METH_NOARGS, "Makes it empty."},
    {nullptr, nullptr, 0, nullptr}};
PyMethodDef sequence_methods[] = {
    {"add", reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(&add_item)),
     METH_VARARGS | METH_KEYWORDS, "Adds a message, of fields by name, or of a dict or message."},
    {"clear", &clear_items, METH_NOARGS, "Makes it empty."},
    {nullptr, nullptr, 0, nullptr}};
PyTypeObject* make_type(const char* name, std::size_t size, std::vector<PyType_Slot> slots) {
  slots.push_back({0, nullptr});
  PyType_Spec spec{name, static_cast<int>(size), 0,
                   Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, slots.data()};
  PyObject* const made = PyType_FromSpec(&spec);
  if (made == nullptr) {
    throw py::error_already_set();
  }
  return reinterpret_cast<PyTypeObject*>(made);
}

bool has_numbers(const pb::Descriptor& type, std::set<const pb::Descriptor*>& seen) {
  if (!seen.insert(&type).second) {
    return false;
  }
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    if (field.message_type() != nullptr ? has_numbers(*field.message_type(), seen)
                                        : field.is_repeated() && is_number(field)) {
      return true;
    }
  }
  return false;
}

}  // namespace

void make_message_types() {
  if (message_type != nullptr) {
    return;
  }
  bytes_type = make_type(
      "fastcycle.Bytes", sizeof(BytesObject),
      {{Py_tp_dealloc, slot(&destroy<BytesObject>)}, {Py_bf_getbuffer, slot(&get_buffer)}});
  sequence_type = make_type("fastcycle.Messages", sizeof(SequenceObject),
                            {{Py_tp_dealloc, slot(&destroy<SequenceObject>)},
                             {Py_sq_length, slot(&size_of)},
                             {Py_sq_item, slot(&item_of)}});
  loan_sequence_type = make_type("fastcycle.LoanedMessages", sizeof(SequenceObject),
                                 {{Py_tp_dealloc, slot(&destroy<SequenceObject>)},
                                  {Py_sq_length, slot(&size_of)},
                                  {Py_sq_item, slot(&item_of)},
                                  {Py_tp_methods, sequence_methods}});
  loan_type = make_type("fastcycle.Loan", sizeof(MessageObject),
                        {{Py_tp_dealloc, slot(&destroy<MessageObject>)},
                         {Py_tp_getattro, slot(&get_attribute)},
                         {Py_tp_setattro, slot(&set_attribute)},
                         {Py_tp_repr, slot(&text_of_message)},
                         {Py_tp_methods, loan_methods}});
  message_type = make_type("fastcycle.Message", sizeof(MessageObject),
                           {{Py_tp_dealloc, slot(&destroy<MessageObject>)},
                            {Py_tp_getattro, slot(&get_attribute)},
                            {Py_tp_setattro, slot(&set_attribute)},
                            {Py_tp_repr, slot(&text_of_message)},
                            {Py_tp_methods, message_methods}});
}

Lent::Lent(detail::Envelope& envelope, const pb::Message& payload, detail::Holder holder)
    : shared_(new Shared) {
  shared_->envelope = &envelope;
  shared_->holder = holder;
  detail::retain(envelope);
  object_ = py::reinterpret_steal<py::object>(new_message(shared_, payload));
}

Lent::~Lent() {
  object_ = {};
  if (shared_->count > 1 && shared_->holder != detail::kNobody) {
    shared_->is_kept = true;
    detail::keep(*shared_->envelope, shared_->holder);
  }
  let_go(shared_);
}

py::object make_loan(detail::PublisherCore& publisher, const std::shared_ptr<Link>& link) {
  auto* const shared = new Shared;
  shared->envelope = detail::take_loan(publisher, true);
  shared->publisher = &publisher;
  shared->link = link;
  const auto made = py::reinterpret_steal<py::object>(new_message(shared, *shared->envelope->own));
  let_go(shared);
  return made;
}

HandedMessage hand_over(const py::handle& message, const detail::PublisherCore& publisher,
                        const pb::Descriptor& type) {
  const MessageObject* const object = as_message(message);
  if (object == nullptr) {
    return {};
  }
  Shared& shared = *object->shared;
  check(*object);
  if (&object->info->type != &type) {
    fail(PyExc_TypeError, fmt::format("expected a message {}, found one {}", type.full_name(),
                                      object->info->type.full_name()));
  }
  const bool is_whole =
      object->message == (is_loan(shared) ? shared.envelope->own : shared.envelope->payload);
  if (!is_whole) {
    return {};
  }
  if (!is_loan(shared)) {
    return {Handed::kReceived, shared.envelope, shared.holder};
  }
  if (shared.publisher != &publisher) {
    return {};  // Its contents are copied.
  }
  return {Handed::kLoan, std::exchange(shared.envelope, nullptr), detail::kNobody};
}

const MessageInfo& message_info(const py::handle& message) {
  const MessageObject* const object = as_message(message);
  if (object == nullptr || is_loan(*object->shared)) {
    fail(PyExc_TypeError,
         fmt::format("expected a received message, found {}", Py_TYPE(message.ptr())->tp_name));
  }
  return object->shared->envelope->info;
}

void fill(const py::object& message, const py::handle& value) {
  fill_message(*as_message(message)->message, value);
}

void prepare_for(const pb::Descriptor& type) {
  std::set<const pb::Descriptor*> seen;
  if (has_numpy || !has_numbers(type, seen)) {
    return;
  }
  try {
    py::module_::import("numpy");
    has_numpy = true;
  } catch (py::error_already_set& error) {
    if (!error.matches(PyExc_ImportError)) {
      throw;
    }
  }
}

}  // namespace fastcycle::python
