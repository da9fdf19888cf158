"""Array functions: what a study can be asked can be asked of arrays, and misuse is refused in words."""

import sys

import numpy as np
import pytest
from inertial_motion import turned_hinge
from two_bodies import Pair, record, swing

import pellucid as pl
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint

FS = 1000.0
TIME = np.arange(0.0, 10.0, 1.0 / FS)
ACTIVE = ((TIME % 2.0) > 1.0).astype(float)


@pytest.fixture(scope="module")
def emg():
    rng = np.random.default_rng(0)
    return {
        name: rng.standard_normal(TIME.size) * (0.02 + size * ACTIVE)
        for name, size in (("biceps", 1.0), ("triceps", 0.4), ("deltoid", 0.7))
    }


def test_onsets_of_one_muscle_and_of_several(emg):
    one = pl.onset(emg["biceps"], fs=FS)
    several = pl.onset(emg, fs=FS)
    assert [round(burst.onset.time) for burst in one.bursts] == [1, 3, 5, 7, 9]
    assert list(several) == list(emg)
    assert several["biceps"].bursts == one.bursts


def test_cocontraction_of_equal_envelopes_is_complete():
    envelope = 0.1 + 0.5 * ACTIVE
    assert pl.cocontraction(envelope, envelope, fs=FS).common.value == pytest.approx(100.0)


def test_synergies_of_a_mapping_and_of_an_array_agree(emg):
    envelopes = {m: np.convolve(np.abs(x), np.ones(100) / 100.0, "same") for m, x in emg.items()}
    by_name = pl.synergies(envelopes, fs=FS)
    by_column = pl.synergies(np.column_stack(list(envelopes.values())), fs=FS, muscles=list(envelopes))
    assert len(by_name) == 1
    np.testing.assert_array_equal(by_name.weights, by_column.weights)
    assert by_name.activations.shape == (TIME.size, 1)
    assert list(by_name.to_frame().index) == list(emg)
    assert len(repr(by_name)) < 500


@pytest.mark.parametrize(
    "call", ["onset", "cocontraction", "synergies", "assess", "identify", "check", "report", "calibrate"]
)
def test_what_is_neither_study_nor_array_is_refused(call):
    with pytest.raises(pl.PellucidError, match=f"{call}: found int, expected a study"):
        getattr(pl, call)(3)


@pytest.mark.parametrize("call", ["onset", "synergies"])
def test_arrays_without_a_sampling_rate_are_refused(call, emg):
    with pytest.raises(pl.PellucidError, match="without a sampling rate"):
        getattr(pl, call)(emg)


def test_options_of_arrays_do_not_belong_to_a_study(tmp_path):
    with pytest.raises(pl.PellucidError, match=r"found fs with a study"):
        pl.onset(tmp_path, fs=1000.0)


def test_a_path_is_opened_as_a_study(tmp_path):
    with pytest.raises(pl.PellucidError, match=r"study\.toml"):
        pl.identify(str(tmp_path))


def test_a_table_of_movements_is_assessed_and_certified():
    rng = np.random.default_rng(1)
    rows = {"participant": [], "condition": [], "duration": [], "note": []}
    for person in range(14):
        usual = rng.normal(1.0, 0.1)
        for condition, factor in (("free", 1.0), ("light", 1.01), ("heavy", 1.5)):
            for _ in range(3):
                rows["participant"].append(f"P{person}")
                rows["condition"].append(condition)
                rows["duration"].append(usual * factor * np.exp(rng.normal(0.0, 0.02)))
                rows["note"].append("ok")
    rows["participant"].append("P15")  # does one condition only
    rows["condition"].append("free")
    rows["duration"].append(1.0)
    rows["note"].append("")
    found = pl.assess(rows, control="free", margins={"duration": 0.1})
    assert list(found) == ["duration"]
    assert found.left_out == ("P15",)
    assert found["duration"].pairwise["heavy"].change == pytest.approx(0.5, abs=0.1)
    assert found.certificates["light"].verdict == "transparent"
    assert found.certificates["heavy"].verdict == "not transparent"
    assert set(found.to_frame()["condition"]) == {"light", "heavy"}


def test_a_table_without_its_control_is_refused():
    with pytest.raises(pl.PellucidError, match="expected the control 'none'"):
        pl.assess({"participant": ["A", "A"], "condition": ["x", "y"], "d": [1.0, 2.0]}, control="none")


def test_a_data_frame_is_taken_as_a_mapping_is():
    pandas = pytest.importorskip("pandas")
    rows = {"participant": list("AABBCC"), "condition": ["x", "y"] * 3, "d": [1.0, 2.0, 1.1, 2.1, 0.9, 1.8]}
    one, other = pl.assess(rows, control="x"), pl.assess(pandas.DataFrame(rows), control="x")
    assert one["d"].pairwise["y"].change == other["d"].pairwise["y"].change


def test_ratios_of_values_that_are_not_positive_are_refused():
    with pytest.raises(pl.PellucidError, match="relative=False"):
        pl.certify({"d": ([0.0, 1.0], [1.0, 1.0])}, {"d": 0.1})


def test_a_hinge_is_followed(rng):
    made = turned_hinge(rng, seconds=30.0, noise=0.01)
    fit = pl.fit_hinge(
        made.proximal.time,
        (made.proximal.angular_velocity, made.proximal.acceleration),
        (made.distal.angular_velocity, made.distal.acceleration),
        calibration=10.0,
    )
    away = fit.angle.angle - np.sign(fit.hinge.axes[0] @ made.axes[0]) * made.angle
    assert np.std(away[len(away) // 3 :]) < np.radians(1.0)
    with pytest.raises(pl.PellucidError, match=r"proximal angular velocity: found shape \(3,\)"):
        pl.fit_hinge(made.proximal.time, (np.zeros(3), np.zeros(3)), (np.zeros(3), np.zeros(3)))


@pytest.mark.nightly
def test_a_strap_is_identified_from_swings():
    pair, rng = Pair(), np.random.default_rng(5)
    recorded = [record(truth, rng) for truth in swing(pair, seconds=30.0, count=2)]
    swings = [
        {key: getattr(each, key) for key in ("time", "position", "torque", "imu_time", "imu_angle")}
        for each in recorded
    ]
    orthosis = {name: getattr(pair.orthosis, name) for name in ("inertia", "viscous", "gravity")}
    fit = pl.fit_strap(swings, orthosis)
    assert fit["stiffness"].value == pytest.approx(pair.stiffness, rel=0.1)
    assert fit.strap.model.features == ()
    with pytest.raises(pl.PellucidError, match="expected imu_angle too"):
        pl.fit_strap({k: v for k, v in swings[0].items() if k != "imu_angle"}, orthosis)
    with pytest.raises(pl.PellucidError, match="orthosis: found inertia, expected inertia, viscous, gravity"):
        pl.fit_strap(swings, {"inertia": 0.05})


def test_muscles_are_calibrated_to_a_torque():
    """The torque is a weighted difference of late envelopes: no Hill model makes it."""
    time = np.arange(0.0, 30.0, 0.02)
    angle = -0.6 + 0.4 * np.sin(2.0 * np.pi * 0.3 * time)
    effort = {"vastus_lateralis": 0.5 + 0.4 * np.sin(time), "semitendinosus": 0.5 - 0.4 * np.sin(1.3 * time)}
    torque = 60.0 * np.roll(effort["vastus_lateralis"], 3) - 25.0 * np.roll(effort["semitendinosus"], 3)
    fit = pl.calibrate_muscles(time, effort, {"knee": angle}, torque, groups=np.arange(time.size) // 500)
    told = fit.predict(time, effort, {"knee": angle})
    assert 1.0 - np.var(torque - told) / np.var(torque) > 0.9
    assert any(name.startswith("strength.") for name in fit)
    with pytest.raises(pl.PellucidError, match="found no angle"):
        pl.calibrate_muscles(time, effort, {}, torque)


def test_a_robot_of_two_joints_is_identified():
    """Efforts come from the equations of a planar arm, written out here."""
    time = np.arange(0.0, 30.0, 0.005)
    parts = [(0.6, 0.31), (0.4, 0.83), (0.25, 1.7)], [(0.5, 0.47), (0.45, 1.1), (0.2, 2.1)]
    q, v, a = (
        np.column_stack([sum(f(size, 2 * np.pi * rate) for size, rate in each) for each in parts])
        for f in (
            lambda s, w: s * np.sin(w * time),
            lambda s, w: s * w * np.cos(w * time),
            lambda s, w: -s * w**2 * np.sin(w * time),
        )
    )
    m2, l1, c2, g = 1.5, 0.4, 0.2, 9.81
    inertia2, first, gravity1 = m2 * c2**2, 0.3, 6.0
    c, s = np.cos(q[:, 1]), np.sin(q[:, 1])
    h = m2 * l1 * c2
    turn = m2 * g * c2 * np.sin(q[:, 0] + q[:, 1])
    one = (first + m2 * l1**2 + inertia2 + 2 * h * c) * a[:, 0] + (inertia2 + h * c) * a[:, 1]
    one += -h * s * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2) + (gravity1 + m2 * g * l1) * np.sin(q[:, 0]) + turn
    two = (inertia2 + h * c) * a[:, 0] + inertia2 * a[:, 1] + h * s * v[:, 0] ** 2 + turn
    effort = np.column_stack([one, two]) + [0.8, 0.4] * np.sign(v) + [0.3, 0.1] * v
    effort += 0.01 * np.random.default_rng(3).standard_normal(effort.shape)
    joints = [
        TreeJoint("shoulder", "base", "upper", axis=(0.0, 1.0, 0.0)),
        TreeJoint("elbow", "upper", "fore", axis=(0.0, 1.0, 0.0), place=(0.0, 0.0, -l1)),
    ]
    links = [
        Link.about_centre(name, 1.0, (0.0, 0.0, -0.2), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01)) for name in ("upper", "fore")
    ]
    recording = {"time": time, "position": q, "effort": effort}
    fit = pl.fit_robot(Tree(joints, links), recording, lowpass=20.0, decimate=5, dead_band=0.2, plain=True)
    for name, truth in (
        ("shoulder.coulomb", 0.8),
        ("elbow.coulomb", 0.4),
        ("shoulder.viscous", 0.3),
        ("elbow.viscous", 0.1),
    ):
        assert fit[name].value == pytest.approx(truth, rel=0.05), name
    assert {"value", "unit"} <= set(fit.to_frame().columns)
    assert fit.plot() is not None
    with pytest.raises(pl.PellucidError, match=r"expected \(6000, 2\)"):
        pl.fit_robot(Tree(joints, links), {**recording, "effort": effort[:, :1]}, lowpass=10.0)


def test_without_pandas_and_statsmodels_it_is_said_what_to_install(monkeypatch):
    from pellucid.people.mixed_model import mixed_model

    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "statsmodels.regression.mixed_linear_model", None)
    t = np.arange(0.0, 20.0, 0.005)
    q = 0.6 * np.sin(0.8 * t) + 0.3 * np.sin(3.1 * t)
    fit = pl.fit_joint(t, q, 1.5 * np.sin(q) + 0.1 * np.gradient(np.gradient(q, t), t), lowpass=10.0, decimate=5)
    with pytest.raises(pl.PellucidError, match=r'found no package pandas, expected it: pip install "pandas>=2"'):
        fit.to_frame()
    who, under = np.repeat(np.arange(8), 20), np.tile([False, True], 80)
    own = np.random.default_rng(0).normal(0.0, 0.1, 160)
    assert 'pip install "statsmodels' in mixed_model(own, who, under, {}).trouble


def movement_rows(gain, *, people=16, amplitudes=(0.2, 0.4, 0.6, 0.8, 1.0), keep=lambda *where: True, seed=5, each=6):
    """Movements of people whose duration grows with amplitude, `gain` times as long in the condition robot."""
    rng = np.random.default_rng(seed)
    names = ("participant", "condition", "amplitude", "direction", "block", "trial", "target", "period", "duration")
    rows = {name: [] for name in names}
    for person in range(people):
        own = np.exp(rng.normal(0.0, 0.03))
        order = ("free", "robot") if person % 2 else ("robot", "free")
        for period, condition in enumerate(order, start=1):
            trial = 0
            for amplitude in amplitudes:
                for k in range(each):
                    trial += 1
                    duration = (0.4 + 0.6 * amplitude) * own * np.exp(rng.normal(0.0, 0.05))
                    if keep(person, condition, amplitude, k):
                        seconds = duration * (gain if condition == "robot" else 1.0)
                        made = (f"P{person}", condition, amplitude, ("up", "down")[k % 2], k // 2, trial,
                                amplitude + 1.0, period, seconds)  # fmt: skip
                        for name, value in zip(names, made, strict=True):
                            rows[name].append(value)
    return rows


def without(rows, *names):
    return {name: values for name, values in rows.items() if name not in names}


LONG_ONES_MISSING = {"keep": lambda person, condition, amplitude, k: condition == "free" or amplitude < 0.5 or k == 0}
NONE_LEFT = {"keep": lambda person, condition, amplitude, k: condition == "free" or amplitude < 0.5}


@pytest.mark.parametrize("losses", [LONG_ONES_MISSING, NONE_LEFT])
@pytest.mark.parametrize("dropped", [(), ("trial", "block", "period"), ("direction", "target")])
def test_who_is_slower_is_not_certified_where_long_movements_are_missing(losses, dropped):
    """A true change of 15 % that the mean of all rows shows as 3 % or less."""
    rows = without(movement_rows(1.15, **losses), *dropped)
    worn = np.array(rows["condition"]) == "robot"
    duration = np.array(rows["duration"])
    assert duration[worn].mean() / duration[~worn].mean() < 1.03
    found = pl.assess(rows, control="free", margins={"duration": 0.10})
    assert found.certificates["robot"].verdict == "not transparent"
    d = found.certificates["robot"].end_points["duration"]
    assert np.expm1(d.estimate) == pytest.approx(0.15, abs=0.03)
    assert "more than the 10 % that max_left_out allows" in str(found)
    assert found.lost["duration"]["robot"][0] > 0.3 * found.lost["duration"]["robot"][1]


def test_without_columns_that_say_what_is_alike_losses_forbid_the_claim():
    """Neither the claim that a change lies within nor that it lies beyond: long movements may be all that differs."""
    for gain in (1.15, 1.0):
        rows = without(movement_rows(gain, **LONG_ONES_MISSING), "amplitude", "target", "direction")
        found = pl.assess(rows, control="free", margins={"duration": 0.10})
        assert found.certificates["robot"].verdict == "cannot say"
        assert "too many movements are missing" in str(found)


@pytest.mark.parametrize("as_nan", [True, False])
def test_missing_values_and_missing_rows_are_limited_alike(as_nan):
    """One in eight movements at random is more than a tenth; one in twenty is not."""
    for share, verdict in ((0.05, "transparent"), (0.13, "cannot say")):
        rows = movement_rows(1.01)
        drop = (np.random.default_rng(2).uniform(size=len(rows["duration"])) < share) & (
            np.array(rows["condition"]) == "robot"
        )
        if as_nan:
            rows["duration"] = np.where(drop, np.nan, rows["duration"]).tolist()
        else:
            rows = {name: [v for v, gone in zip(own, drop, strict=True) if not gone] for name, own in rows.items()}
        found = pl.assess(rows, control="free", margins={"duration": 0.10})
        assert found.certificates["robot"].verdict == verdict
        allowed = pl.assess(rows, control="free", margins={"duration": 0.10}, max_left_out=0.2)
        assert allowed.certificates["robot"].verdict == "transparent"


def test_too_many_lost_participants_forbid_the_claim():
    rows = movement_rows(1.01, people=18, keep=lambda person, condition, *_: condition == "free" or person > 2)
    found = pl.assess(rows, control="free", margins={"duration": 0.10})
    assert len(found.left_out) == 3
    assert found.certificates["robot"].verdict == "cannot say"
    assert "too many participants are missing" in str(found)


def test_columns_of_the_design_are_no_indices():
    rows = movement_rows(1.02)
    rows["Trial number"], rows["repetition"] = rows["trial"], rows["block"]
    rows["amplitude [deg]"] = [57.3 * a for a in rows["amplitude"]]
    rows["target_error"] = [0.01 + 0.001 * i % 7 for i in range(len(rows["trial"]))]
    found = pl.assess(rows, control="free")
    assert list(found) == ["duration", "target_error"]
    assert set(found.factors) == {"amplitude", "amplitude [deg]", "target", "direction"}
    assert list(pl.assess(rows, control="free", indices=["duration"])) == ["duration"]
    other = pl.assess(without(rows, "amplitude", "amplitude [deg]", "target") | {"level": rows["amplitude"]},
                      control="free", factors=["level", "direction"])  # fmt: skip
    np.testing.assert_array_equal(other["duration"].values, found["duration"].values)
    with pytest.raises(pl.PellucidError, match="both as index and as factor"):
        pl.assess(rows, control="free", indices=["duration", "amplitude"], factors=["amplitude"])


@pytest.mark.parametrize(
    "name", ["distance", "target_distance", "width", "load [kg]", "speed_condition", "gap", "indexOfDifficulty", "q7"]
)
def test_a_designed_level_of_any_name_is_a_factor_and_no_index(name):
    rows = without(movement_rows(1.15, **LONG_ONES_MISSING), "direction", "target")
    rows[name] = rows.pop("amplitude")
    found = pl.assess(rows, control="free", margins={"duration": 0.10})
    assert (list(found), found.factors) == (["duration"], (name,))
    assert found.certificates["robot"].verdict == "not transparent"
    assert f"factors, within whose levels movements are compared: {name}" in str(found)
    assert set(found.uncompared) == {"block", "trial", "period"}
    assert name in pl.assess(rows, control="free", indices=["duration", name])


def test_what_was_measured_stays_an_index_and_order_is_told_from_trials():
    rows = without(movement_rows(1.0), "period", "trial", "block")
    rng, n = np.random.default_rng(3), len(rows["duration"])
    rows["peaks"] = rng.choice([1, 2, 3], n, p=[0.7, 0.2, 0.1]).tolist()
    rows["success"] = (rng.uniform(size=n) < 0.8).tolist()
    rows["movement_distance"] = rng.uniform(1.0, 2.0, n).tolist()
    rows["mass"] = [{"free": 0.0, "robot": 2.0}[c] for c in rows["condition"]]
    rows["load"] = rows["mass"]
    odd = np.array([int(p[1:]) % 2 == 1 for p in rows["participant"]])
    rows["order"] = np.where((np.array(rows["condition"]) == "robot") == odd, 2, 1).tolist()
    found = pl.assess(rows, control="free", margins={"duration": 0.10})
    assert list(found) == ["duration", "peaks", "success", "movement_distance", "mass"]
    assert "load has other levels in every condition" in str(found)
    own = found.certificates["robot"].end_points["duration"]
    assert not own.fit.is_plain
    assert own.tested_again(largest_carry_over=9.0).p_within > own.p_within


def test_why_a_claim_is_not_made_is_said_with_the_people_and_losses_that_decided():
    def said(people, gain=1.0, **options):
        rows = movement_rows(gain, people=people, **options)
        found = pl.assess(rows, control="free", margins={"duration": 0.10})
        (line,) = [line for line in str(found).splitlines() if line.startswith("robot: ")]
        return line

    lacking = {"keep": lambda person, condition, *_: condition == "free" or person != 3}
    assert "too few participants: 11 took part" in said(12, **lacking)
    assert "1 of 12 excluded" in said(12, **lacking)
    for line in (said(13, **lacking), said(12)):
        assert line.startswith("robot: transparent (duration ")
        assert "12 of 12 within" in line
    assert "extends beyond the margin, -9.1 to +10.0 %" in said(16, 1.10)


def test_amplitudes_drawn_at_random_are_pooled_and_told():
    rows = movement_rows(1.02)
    drawn = np.random.default_rng(1).uniform(0.0, 1.0, len(rows["trial"]))
    rows["amplitude"] = (np.array(rows["amplitude"]) + drawn).tolist()
    found = pl.assess(without(rows, "target"), control="free")
    assert found.factors == ("direction",)
    assert "amplitude has" in str(found)
    assert "not compared within them" in str(found)
    rows["amplitude"][3] = float("nan")
    with pytest.raises(pl.PellucidError, match="column amplitude, row 3: found no value"):
        pl.assess(rows, control="free")


def test_an_effect_of_order_takes_the_claim_from_a_table_too():
    """Everybody is 12 % slower in the second period, and nearly all wear the robot in the first."""
    rows = movement_rows(1.0)
    by_person = {f"P{k}": k in (1, 3) for k in range(16)}
    late = np.array([by_person[p] for p in rows["participant"]])
    worn = np.array(rows["condition"]) == "robot"
    rows["period"] = np.where(worn ^ late, 1, 2).tolist()
    slower = np.where(np.array(rows["period"]) == 2, 1.12, 1.0)
    rows["duration"] = (np.array(rows["duration"]) * slower * np.where(worn, 1.10, 1.0)).tolist()
    plain = pl.assess(without(rows, "period"), control="free", margins={"duration": 0.10})
    found = pl.assess(rows, control="free", margins={"duration": 0.10})
    assert plain.certificates["robot"].tested("duration") == "within"
    assert found.certificates["robot"].verdict == "cannot say"
    assert found.certificates["robot"].end_points["duration"].estimate == pytest.approx(np.log(1.10), abs=0.02)


def test_a_table_of_a_study_is_certified_as_the_study_is(tmp_path):
    """The movements that the command found, as a table: the same values, the same certificate."""
    import made_pointing

    from pellucid.study.procedures.registry import open_study

    study = made_pointing.study(tmp_path, participants=12, conditions=("Ctrl", "FC", "PCFr"), repetitions=1)
    path = study.folder / "study.toml"
    path.write_text(path.read_text(encoding="utf-8") + '[assessment.margins]\nvmax = "10 %"\n', encoding="utf-8")
    whole = pl.assess(open_study(study.folder), studies=5)
    rows = {
        "participant": [m.participant for m in whole.measured], "condition": [m.condition for m in whole.measured],
        "amplitude": [m.cell[0] for m in whole.measured], "direction": [m.cell[1] for m in whole.measured],
        "vmax": [m.values["vmax"] for m in whole.measured],
    }  # fmt: skip
    table = pl.assess(rows, control="Ctrl", margins={"vmax": 0.10})
    np.testing.assert_allclose(table["vmax"].values, whole.assessed["vmax"].table.values, rtol=1e-12)
    for each in whole.certified:
        own, other = each.certificate.end_points["vmax"], table.certificates[each.condition].end_points["vmax"]
        assert other.p_within == own.p_within
        assert other.interval == pytest.approx(own.interval)
        assert table.certificates[each.condition].verdict == each.certificate.verdict
        for name, change in table["vmax"].pairwise.items():
            match = whole.assessed["vmax"].comparison.pairwise[name]
            assert (change.p, change.cliff) == (match.p, match.cliff)


def test_margins_of_known_indices_are_those_of_a_study():
    """A smaller end-point error is never worse, and SPARC has no zero to take a share of."""
    rng = np.random.default_rng(6)
    free = rng.normal(1.0, 0.1, 16)
    better = 0.6 * free * np.exp(rng.normal(0.0, 0.03, 16))
    assert pl.certify({"end_absolute": (free, better)}, {"end_absolute": 0.1}).verdict == "transparent"
    both_ways = pl.certify({"duration": (free, better)}, {"duration": 0.1})
    assert both_ways.verdict == "not transparent"
    with pytest.raises(pl.PellucidError, match="sparc: found a share, expected a change in 1"):
        pl.certify({"sparc": (-free, -better)}, {"sparc": 0.1})
