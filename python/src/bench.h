#pragma once

#include <cstdint>
#include <filesystem>
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
/// @errors   `std::runtime_error` with every mistake when the components do not fit together.
class Bench {
 public:
  struct Received {
    std::string message;
    std::int64_t publish_time_ns = 0;
    std::uint64_t sequence = 0;
    std::int64_t taken_ns = 0;
  };

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

  void start();
  [[nodiscard]] bool is_started() const;
  void advance(Duration span);
  void stop();
  [[nodiscard]] Time now() const;

  void publish(const std::string& input, const std::string& message, std::optional<Time> taken);
  std::vector<Received> take(const std::string& output);

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
