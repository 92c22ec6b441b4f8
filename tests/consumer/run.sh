#!/usr/bin/env bash
# run.sh <build folder> <scratch folder> <cmake> <compiler>
#
# Installs the build to a prefix of its own, builds the outside project against that, and runs it
# twice: from its build folder, and after it was installed beside FastCycle. Then builds what the guide for
# beginners shows.
set -euo pipefail

build=$1 scratch=$2 cmake=$3 compiler=$4
project=$(cd "$(dirname "$0")/project" && pwd)
prefix=$scratch/prefix
outside=$scratch/outside
unset LD_LIBRARY_PATH

fail() { echo "consumer: $*" >&2; exit 1; }

# The application must end well and must have carried messages on each of `topics`.
run() {
  local output
  output=$("$prefix/bin/fastcycle" run "$1" --for 1s 2>&1) || fail "run failed:"$'\n'"$output"
  echo "$output"
  local topic
  for topic in planning/speed control/speed; do
    grep -q "$topic" <<<"$output" || fail "the final table has no topic $topic"
  done
}

rm -rf "$prefix" "$outside" "$scratch/elsewhere"
"$cmake" --install "$build" --prefix "$prefix" >"$scratch/install.log"

"$cmake" -S "$project" -B "$outside" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_PREFIX_PATH="$prefix"
"$cmake" --build "$outside" -j 2
(cd "$outside" && ctest --output-on-failure --no-tests=error)
run "$outside/speed_demo.json"

# Installed, the libraries are found without standing beside the application.
"$cmake" --install "$outside" --prefix "$prefix" >>"$scratch/install.log"
mkdir "$scratch/elsewhere"
cp "$project/speed_demo.json" "$scratch/elsewhere/"
rm -rf "$outside"
run "$scratch/elsewhere/speed_demo.json"

# What the guide for beginners says, typed and written as it says it.
guide=$scratch/guide
page=$(cd "$(dirname "$0")/../../docs/guides" && pwd)/first_component.md
rm -rf "$guide"
mkdir "$guide"
"$(dirname "$0")/guide.py" "$page" >"$scratch/guide.sh"
export PATH=$prefix/bin:$PATH CXX=$compiler CMAKE_GENERATOR=Ninja CTEST_OUTPUT_ON_FAILURE=1
output=$(cd "$guide" && bash "$scratch/guide.sh" 2>&1) || fail "the guide failed:"$'\n'"$output"
echo "$output"
for line in 'speed/value .* published' 'limiter/value .* published' '100% tests passed' 'guide: .* commands'; do
  grep -q "$line" <<<"$output" || fail "the guide does not lead to: $line"
done
