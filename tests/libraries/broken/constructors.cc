// Components that do in their constructors what no component may do.

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include <fastcycle/fastcycle.h>
#include <unistd.h>

namespace {

class Aborts final : public fastcycle::Component {
 public:
  explicit Aborts(fastcycle::Context& context) : Component(context) {
    std::fputs("assertion failed: wheel_count == 4\n", stderr);
    std::abort();
  }
};

class Exits final : public fastcycle::Component {
 public:
  explicit Exits(fastcycle::Context& context) : Component(context) { std::exit(7); }
};

class Hangs final : public fastcycle::Component {
 public:
  explicit Hangs(fastcycle::Context& context) : Component(context) {
    for (;;) {
      pause();
    }
  }
};

class Crashes final : public fastcycle::Component {
 public:
  explicit Crashes(fastcycle::Context& context) : Component(context) {
    // A sanitizer would report the access and end the process in its own way.
    std::signal(SIGSEGV, SIG_DFL);
    std::raise(SIGSEGV);
  }
};

class Throws final : public fastcycle::Component {
 public:
  explicit Throws(fastcycle::Context& context) : Component(context) {
    throw std::runtime_error("the map has no roads");
  }
};

/// What it throws is more than a report of the trial may have in one line.
class ThrowsMuch final : public fastcycle::Component {
 public:
  explicit ThrowsMuch(fastcycle::Context& context) : Component(context) {
    throw std::runtime_error("no road from " + std::string(2'000'000, 'a'));
  }
};

/// Without an error, but for the period that its `serve` needs.
class Serves final : public fastcycle::Component {
 public:
  explicit Serves(fastcycle::Context& context) : Component(context) {}

 private:
  void serve() override {}
};

}  // namespace

FASTCYCLE_COMPONENTS(Aborts, Exits, Hangs, Crashes, Throws, ThrowsMuch, Serves)
