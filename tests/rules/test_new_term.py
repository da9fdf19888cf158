"""A friction term is added in its header and in its catalogue: what fits, carries, watches, shows and exports a joint
then knows it, whatever its name begins with. With the header alone, the battery over the catalogue finds it half added.
"""

import json
import shutil
import subprocess
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from copied_package import run_copied

ROOT = Path(__file__).parents[2]
HEADER = {
    "load_motoring{}, load_generating{}, velocity_width{};": "load_motoring{}, load_generating{}, velocity_width{}, "
    "windage{};",
    '"w, of the smooth sign tanh(v / w); below 1e-9: the true sign"});\n': '"w, of the smooth sign tanh(v / w); below '
    '1e-9: the true sign"});\n    visit(p.windage, {"windage", {1, -2, 2}, at_least(0), "F_q, drag per v |v|", '
    "Resists{true, 2, 0}});\n",
    "  S stribeck{};                   ///< F_s [N m], 0": "  S windage{};  ///< F_q [N m s^2/rad^2]\n"
    "  S stribeck{};                   ///< F_s [N m], 0",
    "  c.stribeck = select": "  c.windage = params.windage;\n  c.stribeck = select",
    "viscous(c, direction) * velocity;": "viscous(c, direction) * velocity + c.windage * velocity * abs(velocity);",
}
CATALOGUE = {
    "TERMS: tuple[FrictionTerm, ...] = (\n": 'WINDAGE = FrictionTerm("windage", "drag", "Windage", '
    '"Record fast motions.")\n\n'
    "TERMS: tuple[FrictionTerm, ...] = (\n",
    "    SQUARE_ROOT,\n": "    SQUARE_ROOT,\n    WINDAGE,\n",
    "is_default=False),\n)\n": 'is_default=False),\n    FrictionFamily("drag", frozenset({"drag"}), "friction with the '
    'square of speed", "good", is_default=False),\n)\n',
}
BATTERY = f"""
import sys
sys.path.append({str(ROOT / "tests")!r})
from term_battery import faults
print(*faults(), sep="\\n")
"""
DISPATCH = """
#include "hill_kernels.hpp"
#include "kernels.hpp"
#include "tree_kernels.hpp"
namespace bindings {
namespace baseline {
extern const Kernels kernels;
extern const HillKernels hill_kernels;
extern const TreeKernels tree_kernels;
}
const Kernels& best_kernels() { return baseline::kernels; }
const HillKernels& best_hill_kernels() { return baseline::hill_kernels; }
const TreeKernels& best_tree_kernels() { return baseline::tree_kernels; }
}
"""
USED = """
import json, sys
from pathlib import Path
import numpy as np
import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.export.c_folder import check_on_host, write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.study.drawing.style import colour
from pellucid.models.friction_terms import FAMILIES_BY_NAME
from pellucid.study.pages.quantities import parameter_label
from pellucid.joint.study.joint_case import advice
t = np.arange(0.0, 30.0, 5e-3)
parts = [(0.5, 0.13, 0.0), (0.3, 0.47, 1.0), (0.15, 1.1, 2.0)]
q = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)
v = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p) for a, f, p in parts)
acc = -sum(a * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)
effort = 0.05 * acc + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v + 0.07 * v * np.abs(v)
effort += 0.01 * np.random.default_rng(1).standard_normal(len(t))
fit = pl.fit_joint(t, q, effort, friction="drag", lowpass=10.0, decimate=5)
law = pl.controller(fit, limits=pl.Limits(effort=5.0, rate=500.0, velocity=10.0, position=(-2.0, 2.0)))
safe = pl.supervised(law)
known = next(p.carried for p in fit.card().parameters if p.name == "windage")
try:
    pl.fit_joint(t, q, effort, friction="drag", lowpass=10.0, known={"windage": -1.0})
    negative = "taken"
except PellucidError as error:
    negative = str(error)
folder = write_c_folder("new", ControllerValues("joint", law.values, {}, ("joint.json",), {}), Path(sys.argv[1]))
print(json.dumps({"value": fit["windage"].value, "unit": fit["windage"].unit,
                  "carried": law.values["windage"], "known": known, "negative": negative,
                  "carried_at_one": sum(law.values[n] for n in ("coulomb_positive", "viscous_positive", "windage")),
                  "found_at_one": sum(fit[n].value for n in ("coulomb", "viscous", "windage")),
                  "watched": safe.supervision["body_viscous"] - law.values["viscous_positive"],
                  "header": "float windage;" in (folder / "pellucid_controller.h").read_text(),
                  "exported": check_on_host(folder), "names": [f.name for f in LAWS["joint"].fields][:15],
                  "words": parameter_label("windage"), "advice": advice("windage"),
                  "colour": colour(FAMILIES_BY_NAME[fit.model.family].colour)}))
"""


def replaced(path: Path, by: dict[str, str]) -> None:
    """Each text of `by`, which must be there once, replaced in a file."""
    text = path.read_text(encoding="utf-8")
    for old, new in by.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


@pytest.mark.nightly
@pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is not installed")
def test_a_friction_term_is_its_header_and_its_catalogue(tmp_path):
    nanobind = pytest.importorskip("nanobind")
    for part in ("include", "bindings", "src/pellucid"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    replaced(tmp_path / "include" / "pellucid" / "friction.hpp", HEADER)
    catalogue = tmp_path / "src" / "pellucid" / "models" / "friction_terms.py"
    alone = catalogue.read_text(encoding="utf-8")
    replaced(catalogue, CATALOGUE)
    touched = [p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file()]
    touched = sorted(p.as_posix() for p in touched if (tmp_path / p).read_bytes() != (ROOT / p).read_bytes())
    assert touched == ["include/pellucid/friction.hpp", "src/pellucid/models/friction_terms.py"]  # and a test

    folder = Path(nanobind.__file__).parent
    where = [
        f"-I{tmp_path / 'include'}", f"-I{folder / 'include'}", f"-I{folder / 'ext' / 'robin_map' / 'include'}",
        f"-I{sysconfig.get_paths()['include']}",
    ]  # fmt: skip
    # Plain kernels alone, not optimised: what is asked is whether all of it knows the term.
    options = ["-std=c++17", "-O0", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off"]
    sources = sorted((tmp_path / "bindings").glob("*.cpp"))
    (tmp_path / "bindings" / "dispatch.cpp").write_text(DISPATCH, encoding="utf-8")

    def built(source: Path) -> Path:
        plain = ["-DPELLUCID_ABI=baseline", '-DPELLUCID_INSTRUCTIONS="baseline"'] if "kernels" in source.stem else []
        made = tmp_path / f"{source.stem}.o"
        subprocess.run(["c++", *options, *plain, *where, "-c", str(source), "-o", str(made)], check=True)
        return made

    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(built, [*sources, folder / "src" / "nb_combined.cpp"]))
    module = tmp_path / "src" / "pellucid" / f"_core{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run(["c++", "-shared", *map(str, objects), "-pthread", "-o", str(module)], check=True)
    battery = run_copied(tmp_path / "src", BATTERY)
    assert battery.stdout.strip() == "", battery.stdout + battery.stderr
    whole = catalogue.read_text(encoding="utf-8")
    catalogue.write_text(alone, encoding="utf-8")
    assert "windage: the catalogue has no term for it" in run_copied(tmp_path / "src", BATTERY).stdout
    catalogue.write_text(whole, encoding="utf-8")

    run = run_copied(tmp_path / "src", USED, tmp_path / "out")
    assert run.returncode == 0, run.stderr
    said = json.loads(run.stdout.splitlines()[-1])
    assert said["value"] == pytest.approx(0.07, rel=0.05)
    assert said["unit"] == "N*m*s^2/rad^2"
    # Less than was found is carried; limits and supervisor count it, and no prior makes it drive.
    assert said["carried"] == said["known"] <= said["value"]
    assert said["carried_at_one"] < said["found_at_one"]
    assert said["watched"] == pytest.approx(10.0 * said["carried"])
    assert "known: found windage = -1, expected 0 to" in said["negative"]
    assert said["header"]
    assert said["exported"][1] == 0
    assert "windage" in said["names"]
    assert said["words"] == "Windage"
    assert said["advice"] == "Record fast motions."
    assert said["colour"].startswith("#")
