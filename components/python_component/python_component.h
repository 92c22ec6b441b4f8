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

/// A component that a Python class is: gives its calls to an object of that class.
///
/// @threads  As `Component`. All that is called by Python needs the GIL, which its own calls take.
class PythonComponent final : public Component {
 public:
  explicit PythonComponent(Context& context);
  ~PythonComponent() override;

  void start() override { call(Method::kStart); }
  void activate() override { call(Method::kActivate); }
  void deactivate() override { call(Method::kDeactivate); }
  void serve() override { call(Method::kServe); }
  void stop() override { call(Method::kStop); }

  // For what Python calls.

  using Component::context;
  using Component::health;
  using Component::log;
  using Component::now;
  using Component::random;
  using Component::report;
  using Component::start_time;

  /// Keeps what is to be called back. The result calls it in an activation; what it throws there
  /// is the Python exception in words.
  std::function<void()> call_back(pybind11::object callback);
  /// The same with a message; `holder` is known once the subscription is made.
  detail::EnvelopeCallback call_back_with_message(pybind11::object callback,
                                                  std::shared_ptr<detail::Holder> holder);
  /// A message that it looks at, until its callback ends.
  [[nodiscard]] pybind11::object lend(detail::Envelope& envelope, detail::Holder holder);

  [[nodiscard]] const std::shared_ptr<Link>& link() const { return link_; }
  /// Its message type of this name.
  ///
  /// @errors  std::invalid_argument, which says what may help.
  [[nodiscard]] const google::protobuf::Message& type_named(const std::string& name) const;
  /// @errors  std::runtime_error outside of its constructor.
  void check_constructing(std::string_view call);
  /// @errors  std::runtime_error outside of its calls, such as on a thread of its own.
  void check_in_call(std::string_view call);

 private:
  enum class Method : std::uint8_t { kStart, kActivate, kDeactivate, kServe, kStop, kCount };
  struct Objects;

  void load_messages(const std::vector<std::string>& packages);
  void make_object(const Path& file, const std::string& module, const std::string& class_name);
  /// Adds what is wrong with the param `name`, and throws.
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
