// What reads an application takes time in proportion to its size, also where all of it is wrong.

#include <algorithm>
#include <ctime>
#include <functional>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

std::string listed(int count, const std::function<std::string(int)>& item) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += (i == 0 ? "" : ",\n") + item(i);
  }
  return text;
}

std::string name_of(int i) {
  return "\"c" + std::to_string(i) + '"';
}

std::string component(int i, const std::string& more = {}) {
  return R"({"name": )" + name_of(i) + R"(, "library": "l")" + more + "}";
}

std::string application_of(const std::string& components) {
  return R"({"name": "scale", "components": [)" + components + "]}";
}

/// An application of some size, and the overlay that comes with it, if any.
struct Scaled {
  const char* name;
  int size;  ///< Where work that grows with the square would show.
  std::function<std::string(int size)> application;
  std::function<std::string(int size)> overlay = {};
};

void PrintTo(const Scaled& scaled, std::ostream* stream) {
  *stream << scaled.name;
}

class Loading : public testing::TestWithParam<Scaled> {
 protected:
  /// CPU time of this thread, in seconds, to load the application with `size` things.
  [[nodiscard]] double time_of(int size) const {
    const TestFolder folder;
    LoadOptions options{.file = folder.write("app.json", GetParam().application(size))};
    if (GetParam().overlay) {
      options.overlays = {folder.write("overlay.json", GetParam().overlay(size))};
    }
    const double before = now();
    Problems problems;
    const ApplicationDescription application = load(options, problems);
    EXPECT_EQ(start_order(application).size(), application.components.size());
    return now() - before;
  }

 private:
  static double now() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) / 1e9;
  }
};

TEST_P(Loading, OfFourTimesAsMuchTakesAboutFourTimesAsLong) {
  // The least of some attempts: what else runs on the machine makes a single one longer. One is
  // enough where it holds, and is all that a slow machine has time for.
  double small = std::numeric_limits<double>::infinity();
  double large = std::numeric_limits<double>::infinity();
  const double bound = 9;  // 16 if the work grows with the square.
  for (int attempt = 0; attempt < 3 && !(large < bound * small); ++attempt) {
    small = std::min(small, time_of(GetParam().size));
    large = std::min(large, time_of(4 * GetParam().size));
  }

  EXPECT_LT(large / small, bound) << small << " s, " << large << " s";
}

INSTANTIATE_TEST_SUITE_P(
    Scale, Loading,
    testing::Values(
        Scaled{"components", 2000,
               [](int size) {
                 return application_of(listed(size, [](int i) { return component(i); }));
               }},
        Scaled{"components_of_one_name", 4000,
               [](int size) {
                 return application_of(listed(size, [](int) { return component(0); }));
               }},
        Scaled{"folders_of_libraries", 4000,
               [](int size) {
                 return R"({"name": "scale", "library_path": [)" + listed(size, name_of) +
                        R"(], "components": []})";
               }},
        Scaled{"components_that_start_after_each_other", 2000,
               [](int size) {
                 return application_of(listed(size, [](int i) {
                   return component(i, R"(, "after": [)" + name_of(i + 1) + "]");
                 }));
               }},
        Scaled{"components_that_start_in_a_circle", 2000,
               [](int size) {
                 return application_of(listed(size, [size](int i) {
                   return component(i, R"(, "after": [)" + name_of((i + 1) % size) + "]");
                 }));
               }},
        Scaled{"components_that_start_after_unknown_ones", 3000,
               [](int size) {
                 return application_of(listed(
                     size, [](int i) { return component(i, R"(, "after": ["somebody_else"])"); }));
               }},
        Scaled{"processes_that_no_component_is_in", 3000,
               [](int size) {
                 return R"({"name": "scale", "processes": [)" +
                        listed(size, [](int i) { return R"({"name": )" + name_of(i) + "}"; }) +
                        R"(], "components": [)" +
                        listed(size,
                               [](int i) {
                                 return component(i,
                                                  R"(, "process": "d)" + std::to_string(i) + '"');
                               }) +
                        "]}";
               }},
        Scaled{"components_that_an_overlay_changes", 3000,
               [](int size) {
                 return application_of(listed(size, [](int i) { return component(i); }));
               },
               [](int size) {
                 return R"({"components": [)" +
                        listed(size,
                               [size](int i) {
                                 return R"({"name": )" + name_of(size - 1 - i) +
                                        R"(, "serve_period_ms": 5})";
                               }) +
                        "]}";
               }},
        Scaled{"components_that_an_overlay_does_not_find", 3000,
               [](int size) {
                 return application_of(listed(size, [](int i) { return component(i); }));
               },
               [](int size) {
                 return R"({"components": [)" +
                        listed(size,
                               [](int i) {
                                 return R"({"name": "d)" + std::to_string(i) +
                                        R"(", "serve_period_ms": 5})";
                               }) +
                        "]}";
               }}),
    [](const auto& scaled) { return std::string(scaled.param.name); });

}  // namespace
}  // namespace fastcycle::config
