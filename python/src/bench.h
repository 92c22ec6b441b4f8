#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fastcycle/component.h"
#include "fastcycle/params.h"

namespace fastcycle::python {

/// The bench of `fastcycle/testing.h` for components of libraries, with messages as serialized
/// bytes of types that are known by name.
///
/// @threads  Confined.
/// @errors   `std::runtime_error` with every error when the components do not fit together.
class Bench {
 public:
  struct Received {
    std::string message;
    std::int64_t publish_time_ns = 0;
    std::uint64_t sequence = 0;
    std::int64_t taken_ns = 0;
  };

  /// How a call ended; `reply` is empty without one.
  struct Answer {
    std::string status;
    std::string error;
    std::string reply;
  };
  /// What a test makes of a request: a reply, or why there is none.
  struct Handled {
    std::optional<std::string> reply;
    std::string reason;
  };
  /// Called on the thread that serves the component.
  using Handler = std::function<Handled(const std::string& request)>;

  /// `folders` is where component libraries are looked for first.
  explicit Bench(std::vector<std::filesystem::path> folders);
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  ~Bench();

  /// `configuration`: what the application file would say of the component, its name and library
  /// included, as JSON.
  void add(const std::string& configuration);
  /// As `fastcycle::testing::Bench::configure`.
  void configure(const std::string& application);
  /// Components that publish and listen for the test; returns their names.
  std::string add_input(const std::string& topic, const std::string& type);
  std::string add_output(const std::string& topic, const std::string& type);

  /// The same that call a service, and give one. Without a handler requests wait to be taken.
  std::string add_client(const std::string& service, const std::string& request,
                         const std::string& reply);
  std::string add_service(const std::string& service, const std::string& request,
                          const std::string& reply, Handler handler);

  void start();
  [[nodiscard]] bool is_started() const;
  void advance(Duration span);
  void stop();
  [[nodiscard]] Time now() const;

  void publish(const std::string& input, const std::string& message, std::optional<Time> taken);
  std::vector<Received> take(const std::string& output);

  /// Calls are numbered from 0; so are requests.
  std::size_t call(const std::string& client, const std::string& request,
                   std::optional<Duration> deadline);
  [[nodiscard]] std::optional<Answer> answer_of(const std::string& client, std::size_t call) const;
  void cancel(const std::string& client, std::size_t call);
  std::vector<std::pair<std::size_t, std::string>> take_requests(const std::string& service);
  void answer(const std::string& service, std::size_t request, const std::string& reply);
  void reject(const std::string& service, std::size_t request, const std::string& reason);

  ParamsResult change_params(const std::vector<ParamChange>& changes);
  void switch_mode(const std::string& mode);
  [[nodiscard]] std::string mode() const;
  void activate(const std::string& name);
  void deactivate(const std::string& name);
  [[nodiscard]] bool is_active(const std::string& name) const;
  [[nodiscard]] std::vector<std::pair<std::string, ReportValue>> results(
      const std::string& name) const;
  [[nodiscard]] std::vector<std::string> faults(const std::string& name) const;

 private:
  struct State;

  std::unique_ptr<State> state_;
};

/// The `FileDescriptorSet` of a message type that some library has brought.
///
/// @errors  `NotFound` if none has.
[[nodiscard]] std::string schema_of_type(const std::string& type);

}  // namespace fastcycle::python
