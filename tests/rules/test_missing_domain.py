"""A domain whose folder is missing leaves the rest at work, and what needs it says so."""

import shutil

import pytest
from copied_package import copied_package, run_copied

from pellucid._domains import DOMAIN_NAMES, find_domains

USED = """
import sys
import numpy as np
from typer.testing import CliRunner
import pellucid as pl
gone = sys.argv[1]
lacking = []
for name in dir(pl):
    try:
        getattr(pl, name)
    except ModuleNotFoundError as error:
        assert f"pellucid.{gone}" in str(error), (name, error)
        lacking.append(name)
from pellucid import cli
done = CliRunner().invoke(cli.app, ["--help"])
assert done.exit_code == 0, repr(done.exception)
t = np.arange(0.0, 10.0, 1e-3)
q = 0.5 * np.sin(2.5 * t) + 0.2 * np.sin(6.9 * t)
v = np.gradient(q, t)
if "fit_joint" not in lacking:
    fit = pl.fit_joint(t, q, 0.05 * np.gradient(v, t) + 1.5 * np.sin(q) + 0.1 * v + 0.2 * np.sign(v),
                       friction="symmetric", lowpass=20.0, decimate=10)
    assert abs(fit["gravity"].value - 1.5) < 0.05
sys.argv = ["pellucid", "export", "nowhere"]
try:
    cli.main()
except SystemExit as stop:
    assert stop.code == 2, stop.code
print(",".join(lacking))
"""
"""Program that uses what is left of the package, and prints the public names that are lacking."""

LACKING = {
    "arm": "fit_robot", "controllers": "export", "emg": "TorqueRegressor", "joint": "fit_joint",
    "orthosis": "fit_hinge", "people": "certify",
}  # fmt: skip
"""A public name of each domain."""


TRIED_QUICKLY = ("joint", "people")
"""Domains that every run leaves out; `test_layers` finds an import of any other domain without running it."""


def test_every_domain_is_listed():
    found = {domain.__name__.split(".")[-2] for domain in find_domains()}
    assert set(DOMAIN_NAMES) == set(LACKING) == found - {"study"}


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A copy of the package, without the lab, which uses every domain."""
    copy = copied_package(tmp_path_factory.mktemp("copy"))
    shutil.rmtree(copy.parent / "pellucid_lab")
    return copy


@pytest.mark.slow
@pytest.mark.parametrize(
    "domain", [pytest.param(name, marks=() if name in TRIED_QUICKLY else pytest.mark.nightly) for name in DOMAIN_NAMES]
)
def test_the_rest_works_without_a_domain(domain, package, tmp_path):
    shutil.move(package / domain, tmp_path / domain)
    try:
        done = run_copied(package.parent, WITHOUT_LAB + USED, domain)
    finally:
        shutil.move(tmp_path / domain, package / domain)
    assert done.returncode == 0, done.stdout + done.stderr
    assert LACKING[domain] in done.stdout.splitlines()[-1].split(",")
    if domain == "controllers":
        assert "needs pellucid/controllers, which this installation lacks" in done.stderr


WITHOUT_LAB = """
import pellucid._plugins as plugins
original = plugins._entries
plugins._entries = lambda path: [entry for entry in original(path) if entry.distribution != "pellucid-lab"]
"""
"""Lines that hide the entry points of the lab."""
