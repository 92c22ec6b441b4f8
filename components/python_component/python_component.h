#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "fastcycle/fastcycle.h"
#include "message.h"

namespace fastcycle::python {

/// A component implemented by a Python class: forwards its calls to an object of that class.
///
/// @threads  As `Component`. Functions called by Python need the GIL, which its own calls acquire.
class PythonComponent final : public Component {
 public:
  explicit PythonComponent(Context& context);
  ~PythonComponent() override;

  void start() override { call(Method::kStart); }
  void activate() override { call(Method::kActivate); }
  void deactivate() override { call(Method::kDeactivate); }
  void serve() override { call(Method::kServe); }
  void stop() override { call(Method::kStop); }

  // Called by Python.

  using Component::context;
  using Component::health;
  using Component::log;
  using Component::now;
  using Component::random;
  using Component::report;
  using Component::start_time;

  /// Keeps a callback. The result calls it in an activation; an exception thrown there has the text
  /// of the Python exception.
  std::function<void()> call_back(pybind11::object callback);
  /// The same with a message; `holder` is set once the subscription exists.
  detail::EnvelopeCallback call_back_with_message(pybind11::object callback,
                                                  std::shared_ptr<detail::Holder> holder);
  /// Lends it a message, until its callback ends.
  [[nodiscard]] pybind11::object lend(detail::Envelope& envelope, detail::Holder holder);

  [[nodiscard]] const std::shared_ptr<Link>& link() const { return link_; }
  /// Its message type of this name.
  ///
  /// @errors  std::invalid_argument with a hint.
  [[nodiscard]] const google::protobuf::Message& type_named(const std::string& name) const;
  /// @errors  std::runtime_error outside of its constructor.
  void check_constructing(std::string_view call);
  /// @errors  std::runtime_error outside of its calls, such as on another thread.
  void check_in_call(std::string_view call);

 private:
  enum class Method : std::uint8_t { kStart, kActivate, kDeactivate, kServe, kStop, kCount };
  struct Objects;

  void load_messages(const std::vector<std::string>& packages);
  void make_object(const Path& file, const std::string& module, const std::string& class_name);
  /// Reports an error of the param `name`, and throws.
  [[noreturn]] void refuse(std::string_view name, std::string expected, std::string found,
                           std::string hint = {});
  void warn(const std::string& what, const std::string& hint);
  void warn_of_shared_executor();

  void call(Method method);
  template <typename F>
  void run(F body);

  const std::shared_ptr<Link> link_ = std::make_shared<Link>();
  std::unique_ptr<Objects> objects_;
};

}  // namespace fastcycle::python
