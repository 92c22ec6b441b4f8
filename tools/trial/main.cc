// Loads and constructs an application where it can do no harm; see loading/trial.h.

#include "host/build_for_trial.h"
#include "loading/trial.h"

int main() {
  return fastcycle::host::run_trial_child(fastcycle::host::build_for_trial);
}
