// Loads and constructs an application where it can do no harm; see host/trial.h.

#include "host/trial.h"

int main(int argument_count, char** arguments) {
  return fastcycle::host::run_trial_child(argument_count, arguments);
}
