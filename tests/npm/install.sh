#!/bin/sh
# install.sh FOLDER: puts npm's packages, in the versions of package-lock.json, and what uses them into
# FOLDER. Ends with 77 and says why if there is no npm or no network: then what needs them is skipped.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
folder=$1
command -v node >/dev/null && command -v npm >/dev/null || { echo "npm: not there (./dev setup)"; exit 77; }
mkdir -p "$folder"
cp "$here/live_client.mjs" "$here/read_log.mjs" "$here/package.json" "$folder/"
if cmp -s "$here/package-lock.json" "$folder/installed-lock.json"; then
  exit 0
fi
cp "$here/package-lock.json" "$folder/"
if ! (cd "$folder" && npm ci --no-audit --no-fund --ignore-scripts --loglevel=error) >"$folder/npm.log" 2>&1; then
  cat "$folder/npm.log"
  # What cannot be reached is skipped; what is wrong otherwise is a failure.
  grep -qE 'EAI_AGAIN|ENOTFOUND|ECONNREFUSED|ECONNRESET|ETIMEDOUT|ENETUNREACH|EHOSTUNREACH|network' "$folder/npm.log" &&
    { echo "npm: its registry cannot be reached"; exit 77; }
  exit 1
fi
cp "$here/package-lock.json" "$folder/installed-lock.json"
