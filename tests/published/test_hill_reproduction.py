"""`reproduce hill`, small: one subject of the committed rig, every file, and what must hold of its figures."""

import json

import numpy as np
import pytest

from pellucid.study.results import read_rows
from pellucid_lab.papers.figure import VERDICT_WORDS
from pellucid_lab.papers.hill import release_orders, sections, torque
from pellucid_lab.papers.hill import rows as rows_of_torque
from pellucid_lab.papers.hill.paper import HillPaper
from pellucid_lab.papers.hill.torque import BASELINE_FAMILIES
from pellucid_lab.papers.reproduce import reproduce
from pellucid_lab.seated import swing_design

pytestmark = pytest.mark.nightly  # half a minute of processor time; tests/unit has a faster test of each of its parts


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("hill")
    paper = HillPaper(names=("S4",), workers=1)
    with pytest.MonkeyPatch.context() as patch:
        # Fewer limits of the acceleration are tried for the swing that shows inertia, one of the orders of release,
        # and two baselines of the recorded muscles: all take time, and no test here hangs on their number.
        patch.setattr(swing_design, "_ACCELERATION_LIMIT_COUNT", 3)
        orders = (release_orders.ALL_AT_ONCE, "quick_first")
        patch.setattr(release_orders, "RELEASE_ORDERS", {name: release_orders.RELEASE_ORDERS[name] for name in orders})
        for module in (torque, rows_of_torque, sections):
            patch.setattr(module, "RECORDED_EMG_BASELINES", ("nmco", "ridge"))
        return out, paper, reproduce(paper, out).figures


@pytest.fixture(scope="module")
def rows(made):
    return {r.id: r for r in read_rows(made[0] / "results.json")}


def test_results_have_the_ids_others_rely_on(rows):
    wanted = [
        f"hill.{measure}.{kind}.{who}{tail}"
        for measure in ("rmse", "maxe", "mae")
        for kind in ("truth", "eq12")
        for who in ("mean", "S4")
        for tail in ("", ".truncated")
    ]
    wanted += [f"hill.rmse.truth.{name}" for name in BASELINE_FAMILIES]
    for name in wanted:
        assert np.isfinite(rows[name].value), name
        assert rows[name].unit == "N*m", name
        assert rows[name].split == "heldout", name
    assert rows["hill.adam.spread_ratio"].split == "fitted"
    assert rows["hill.q.error.rich.S4"].split == "simulated"


def test_adam_ends_where_the_closed_form_is_and_a_fixed_rate_wanders(rows):
    assert rows["hill.adam.closed_form_difference"].value < 1e-3
    assert rows["hill.adam.spread_ratio"].value >= 10.0


def test_the_leg_is_found_by_the_richer_swing_and_not_by_the_papers(made, rows):
    assert abs(rows["hill.p.error.rich.S4"].value) < 10.0
    assert abs(rows["hill.q.error.rich.S4"].value) < 2.0
    leg = made[1].subjects["S4"].leg
    assert leg.inertia["two_sines"].standard_error > 10.0 * leg.inertia["rich"].standard_error
    # Passive muscles restore a leg as its weight does, and are taken for weight.
    assert leg.restoring_moment > 1.05 * leg.true_weight_moment


def test_torque_is_near_the_truth_on_the_swing_that_was_held_out(made, rows):
    assert rows["hill.rmse.truth.mean"].value < 1.14
    torque = made[1].subjects["S4"].torque
    assert rows["hill.rmse.truth.S4"].value == pytest.approx(
        float(np.sqrt(np.mean((torque.predicted["hill"] - torque.active) ** 2)))
    )
    # Who cuts both torques off at 0 leaves half the samples without an error.
    assert rows["hill.rmse.truth.mean.truncated"].value < rows["hill.rmse.truth.mean"].value


def test_parameters_stay_within_physiology(made, rows):
    assert rows["hill.parameters.outside"].value == 0
    fit = made[1].subjects["S4"].torque.hill.fit
    assert np.all(fit.z >= fit.problem.lower - 1e-9)
    assert np.all(fit.z <= fit.problem.upper + 1e-9)


def test_the_page_needs_no_other_file_and_every_row_has_a_verdict(made):
    out = made[0]
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "<script src" not in page
    for row in json.loads((out / "reproduction.json").read_text(encoding="utf-8"))["rows"]:
        assert row["verdict"] in VERDICT_WORDS, row["id"]
