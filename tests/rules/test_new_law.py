"""A control law is added by its header, a line in the list and a builder: it is then everywhere that laws are."""

import json
import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest
from copied_package import run_copied

from pellucid import _core

ROOT = Path(__file__).parents[2]
HEADER = """// Gravity of a joint carried, and nothing else.
#pragma once

#include "joint.hpp"
#include "law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct GravityShareParams {
  S gravity_sine{}, gravity_cosine{}, share = S(0.9);
  SafetyParams<S> gate{};  ///< its period is the law's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.gravity_sine, {"gravity_sine", unit::effort, any_number(), "g_s, gravity effort per sin q"});
    visit(p.gravity_cosine, {"gravity_cosine", unit::effort, any_number(), "g_c, gravity effort per cos q"});
    visit(p.share, {"gravity_share", unit::one, pellucid::share(), "of gravity that is carried"});
    pellucid::walk(p.gate, visit);
  }
};

template <class S> struct GravityShareCoefficients {
  GravityShareParams<S> params{};  ///< as they are
  SafetyCoefficients<S> gate{};    ///< shut where the parameters make no sense
};

template <class S> GravityShareCoefficients<S> coefficients(const GravityShareParams<S>& p) noexcept {
  GravityShareCoefficients<S> c{p, coefficients(p.gate)};
  c.gate.valid = c.gate.valid && is_sound(p);
  return c;
}

template <class S> struct GravityShareState {
  SafetyState<S> gate{};  ///< of the last step
};

template <class S> S step(const GravityShareCoefficients<S>& c, GravityShareState<S>& s,
                          const Samples<S>& samples) noexcept {
  S wanted = S(0);
  if (is_heard(samples.position)) {
    const SinCos<S> at = sincos(samples.position.value);
    wanted = c.params.share * (c.params.gravity_sine * at.sin + c.params.gravity_cosine * at.cos);
  }
  return guard(c.gate, s.gate, wanted, S(0), samples.position);
}

template <class S> void reset(GravityShareState<S>& s) noexcept { reset(s.gate); }

template <class S> struct GravityShare {
  using Params = GravityShareParams<S>;
  using Coefficients = GravityShareCoefficients<S>;
  using State = GravityShareState<S>;
  static constexpr const char* name = "gravity_share";
  static constexpr const char* type = "GravityShare";
  static constexpr const char* title = "a share of a joint's gravity carried";
  static constexpr SensorUse sensors[] = {{Quantity::position, true, 0.8, 4e-4}};
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
"""
BUILDER = '''

from .control_law import LAWS, gate_values
from .elbow_laws import ELBOW_LIMITS, PUBLISHED_PERIOD_S


def gravity_share(card, slider, *, limits=ELBOW_LIMITS, period=PUBLISHED_PERIOD_S):
    """A share of gravity carried, of a coherent body whose carriage is at `slider` [m]."""
    from .joint_compensation import carried_body

    body = carried_body(card, slider)
    own = {name: body[name] for name in ("gravity_sine", "gravity_cosine")}
    return ControlLaw("gravity_share", LAWS["gravity_share"].defaults | own | gate_values(limits, period))


ELBOW_CONTROLLERS["gravity_share"] = ElbowController("a share of gravity carried", "load", gravity_share)
'''
MODULE = """
#include "elbow.hpp"
#include "laws.hpp"
#include "supervision.hpp"
NB_MODULE(new_laws, m) {
  bindings::add_laws(m);
  bindings::add_elbow(m);
  bindings::add_supervision(m);
}
"""
USED = """
import importlib.util, json, re, sys
import numpy as np
from pathlib import Path
from pellucid import _core
spec = importlib.util.spec_from_file_location("new_laws", sys.argv[1])
made = importlib.util.module_from_spec(spec)
spec.loader.exec_module(made)
for name in [name for name in vars(made) if not name.startswith("_")]:
    setattr(_core, name, getattr(made, name))
sys.path.insert(0, sys.argv[2])
import test_laws
from test_export_elbow import CARDS
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.controller import controller, controllers

from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.session import standstill_speed
from pellucid.models.card import CardParameter
from pellucid.models.slider_joint import SliderCard
assert "gravity_share" in LAWS and "gravity_share" in controllers()
test_laws.test_every_number_is_described("gravity_share")
test_laws.test_python_answers_bit_by_bit_as_c("gravity_share", Path(sys.argv[3]))
test_laws.test_it_is_worn_in_the_lab("gravity_share")
test_laws.test_nothing_unsafe_comes_out_of_nonsense("gravity_share", True)
card = SliderCard(
    study="", family="load", method="", motion="rotary", effort_unit="N*m", lifts="flexion",
    parameters=tuple(CardParameter(n, "1", v, 0.0, (v, v)) for n, v in CARDS["load"].items()), covariance=(),
    known={"carriage_mass": 0.48}, rail=(0.12, 0.27), drive={"gain": 1.0}, heldout_error=None, residual_sd=0.0,
    processing="", confidence=0.95, notes=(), checksums={}, pellucid="0",
)
law = controller(card, "gravity_share")
effort = law.run(1e-3 * np.arange(50), np.full(50, 0.5))[-1]
rig = elbow_participants()
moves = standstill_speed(rig, draw_people(rig, np.random.default_rng(1), count=1)[0], law)
print(json.dumps({"effort": effort, "moves": moves, "expected": 0.9 * (law.values["gravity_sine"] * np.sin(0.5)
      + law.values["gravity_cosine"] * np.cos(0.5))}))
"""


def changed(before: Path, after: Path) -> list[str]:
    """Files that differ, by their path."""
    files = {p.relative_to(after) for p in after.rglob("*") if p.is_file()}
    return sorted(
        str(f) for f in files if not (before / f).is_file() or (before / f).read_bytes() != (after / f).read_bytes()
    )


@pytest.mark.nightly
@pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is not installed")
def test_a_law_is_a_header_a_line_and_a_builder(tmp_path):
    nanobind = pytest.importorskip("nanobind")
    ignored = shutil.ignore_patterns("__pycache__", "*.so", "*.pyi")
    for part in ("include", "bindings", "src/pellucid", "tests/unit", "tests/core"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=ignored)
    core = tmp_path / "include" / "pellucid"
    (core / "gravity_share.hpp").write_text(HEADER, encoding="utf-8")
    text = (core / "laws.hpp").read_text(encoding="utf-8")
    text = text.replace("TransparentCompensation>;", "TransparentCompensation, GravityShare>;")
    text = text.replace('#include "joint_comp', '#include "gravity_share.hpp"\n#include "joint_comp')
    (core / "laws.hpp").write_text(text, encoding="utf-8")
    builders = tmp_path / "src" / "pellucid" / "controllers" / "elbow_controllers.py"
    builders.write_text(builders.read_text(encoding="utf-8") + BUILDER, encoding="utf-8")
    parts = [changed(ROOT / part, tmp_path / part) for part in ("include", "bindings", "src/pellucid")]
    assert parts == [
        ["pellucid/gravity_share.hpp", "pellucid/laws.hpp"],
        [],
        ["controllers/elbow_controllers.py"],
    ]

    folder = Path(nanobind.__file__).parent
    (tmp_path / "module.cpp").write_text(MODULE, encoding="utf-8")
    options = [
        "-std=c++17",
        "-O0",
        "-shared",
        "-fPIC",
        "-fvisibility=hidden",
        "-ffp-contract=off",
        "-DNB_DOMAIN=new_laws",
    ]
    where = [
        f"-I{tmp_path / 'include'}", f"-I{tmp_path / 'bindings'}", f"-I{folder / 'include'}",
        f"-I{folder / 'ext' / 'robin_map' / 'include'}", f"-I{sysconfig.get_paths()['include']}",
    ]  # fmt: skip
    units = ("laws", "read_laws", "healthy_laws", "faulty_laws", "elbow",
             "supervision", "supervised_double", "supervised_float")  # fmt: skip
    own = [f"bindings/{name}.cpp" for name in units]
    sources = ["module.cpp", *own, str(folder / "src" / "nb_combined.cpp")]
    module = tmp_path / f"new_laws{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run(["c++", *options, *where, *sources, "-o", str(module)], cwd=tmp_path, check=True)
    shutil.copy(_core.__file__, tmp_path / "src" / "pellucid")
    run = run_copied(tmp_path / "src", USED, module, tmp_path / "tests" / "unit", tmp_path / "out")
    assert run.returncode == 0, run.stderr
    said = json.loads(run.stdout.splitlines()[-1])
    assert said["effort"] == pytest.approx(said["expected"], rel=1e-9)
    assert said["moves"] < 5.0
