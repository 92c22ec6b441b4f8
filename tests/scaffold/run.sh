#!/usr/bin/env bash
# run.sh <build folder> <scratch folder> <cmake> <compiler>
#
# Installs the build to a prefix of its own, and does what a user of `fastcycle new` does: begins a project, builds,
# tests and runs it; adds components and messages, and does so again.
set -euo pipefail

build=$1 scratch=$2 cmake=$3 compiler=$4
prefix=$scratch/prefix
unset LD_LIBRARY_PATH

fail() { echo "scaffold: $*" >&2; exit 1; }

# build_and_run <topic ...>: the project here builds, passes its tests, and says something on each topic.
build_and_run() {
  local output topic
  "$cmake" -B build -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_CXX_FLAGS=-Werror >/dev/null
  "$cmake" --build build -j 2
  (cd build && ctest --output-on-failure --no-tests=error)
  output=$(fastcycle run build/garage_door.json --for 2s --clock simulated 2>&1) || fail "run failed:"$'\n'"$output"
  echo "$output"
  for topic; do grep -q "^$topic .* published" <<<"$output" || fail "nothing is published on $topic"; done
}

rm -rf "$prefix" "$scratch/garage_door"
"$cmake" --install "$build" --prefix "$prefix" >"$scratch/install.log"
export PATH=$prefix/bin:$PATH
for program in bin/fastcycle libexec/fastcycle/fastcycle-trial; do
  [ "$(stat -c %a "$prefix/$program")" = 711 ] || fail "others may read $program: its memory is open while it starts"
done

cd "$scratch"
said=$("$prefix/bin/fastcycle" new app garage_door)
grep -q '^  fastcycle run build/garage_door.json --for 2s$' <<<"$said" || fail "it does not say what is next: $said"
grep -q 'CMAKE_PREFIX_PATH' <<<"$said" && fail "what PATH leads to needs no CMAKE_PREFIX_PATH: $said"
cd garage_door
build_and_run garage_door/value
[ -f build/application.schema.json ] || fail "the schema is not where the application file says it is"

fastcycle new component motor
fastcycle new messages light
fastcycle new component lamp --messages light
build_and_run garage_door/value motor/value

# One that reads the system's clock is found by the test of the application.
cp components/garage_door.cc right.cc
sed -i 's/^#include "garage_door.h"/&\n#include <chrono>/;
        s/->set_value(.*);/->set_value(static_cast<double>(std::chrono::system_clock::now().time_since_epoch().count()));/' \
  components/garage_door.cc
cmp -s components/garage_door.cc right.cc && fail "the template has no value to set"
"$cmake" --build build -j 2 >/dev/null
if (cd build && ctest -R 'garage_door.repeats' >repeats.log 2>&1); then
  fail "a component that reads the system's clock passes garage_door.repeats"
fi
mv right.cc components/garage_door.cc

# What the editor and pkg-config read.
python3 -c 'import json, sys; [json.load(open(file)) for file in sys.argv[1:]]' .vscode/*.json build/garage_door.json
if command -v pkg-config >/dev/null; then
  export PKG_CONFIG_PATH=$prefix/lib/pkgconfig
  [ "$(pkg-config --variable=componentdir fastcycle | xargs realpath)" = "$(realpath "$prefix/lib/fastcycle")" ] ||
    fail "pkg-config has the wrong componentdir"
  # shellcheck disable=SC2046
  "$compiler" -shared -fPIC $(pkg-config --cflags fastcycle) -Ibuild/garage_door_messages.generated \
    components/garage_door.cc -o build/libby_hand.so $(pkg-config --libs fastcycle) \
    build/libgarage_door_messages.so
fi
