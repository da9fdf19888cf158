"""Run every benchmark, print a table, write benchmarks.json."""

import json
import platform
import sys
from pathlib import Path

from pellucid._atomic import write_text_atomically

from . import (
    arm,
    calibration,
    commands,
    elbow,
    emg_estimator,
    export,
    hill,
    identification,
    kinematic_tree,
    laws,
    muscle_calibration,
    people,
    plant,
    transfer_function,
)

MODULES = (
    identification,
    plant,
    elbow,
    emg_estimator,
    transfer_function,
    hill,
    muscle_calibration,
    kinematic_tree,
    arm,
    people,
    laws,
    export,
    commands,
    calibration,
)


def main() -> None:
    rows = [row for module in MODULES for row in module.run()]
    width = max(len(row["name"]) for row in rows)
    for row in rows:
        print(f"{row['name']:<{width}}  {row['value']:>12.4g} {row['unit']:<6} {row['note']}")
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("benchmarks.json")
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    write_text_atomically(out, json.dumps({"machine": machine, "figures": rows}, indent=2) + "\n")
    print(f"written to {out}")


if __name__ == "__main__":
    main()
