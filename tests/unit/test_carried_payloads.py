"""Payloads of a robot's study: held-out recordings judge, and reach neither the empty robot nor the drives' gains."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_payload import GAINS, LOAD, arm, played

from pellucid._errors import IdentificationError
from pellucid.arm.fit.friction_terms import PLAIN_TERMS
from pellucid.arm.fit.payload import with_drive_gains as with_known_gains
from pellucid.arm.study.tree_findings import report_payload
from pellucid.arm.study.tree_result import identify_payloads, with_gains
from pellucid.study.study_file import PayloadSpec

TRUE_MASS = float(LOAD[0])


def study(gains="payload"):
    table = SimpleNamespace(gains=gains, velocity_width=0.0)
    return SimpleNamespace(table=lambda kind: table)


def best(joints=2):
    return SimpleNamespace(families=(PLAIN_TERMS,) * joints, velocity_width=0.0)


def recorded(robot, name, seed, *, stated=None, use="fit", spoilt=1.0):
    """A recording with a load where a mass is `stated` [kg]; `spoilt` times the current that it took."""
    motion = played(robot, stated is not None, np.random.default_rng(seed), n=240, segments=3, noise=0.02)
    payload = None if stated is None else PayloadSpec(mass=f"{stated} kg")
    return replace(motion, recording=name, use=use, payload=payload, drive=spoilt * motion.drive)


def masses(motions, gains="payload"):
    """The masses found in a study of these recordings by name, and the gains."""
    motions, found = with_gains(study(gains), arm(joints=2), motions)
    return {p.recording: p for p in identify_payloads(study(gains), arm(joints=2), motions, best(), found)}, found


def test_a_held_out_recording_is_no_part_of_the_empty_robot():
    robot = arm(joints=2)
    motions = [recorded(robot, "empty", 1), recorded(robot, "loaded", 2, stated=TRUE_MASS, use="validate")]
    spoilt = recorded(robot, "judge", 3, use="validate", spoilt=1.4)
    *motions, spoilt = (with_known_gains(m, robot, GAINS[1:]) for m in (*motions, spoilt))
    alone, beside = (masses(each, "stated")[0]["loaded"] for each in (motions, [*motions, spoilt]))
    assert beside.mass.value == alone.mass.value
    assert alone.error < 3.0


def test_gains_come_from_recordings_that_are_fitted():
    robot = arm(joints=2)
    motions = [recorded(robot, "empty", 1), recorded(robot, "loaded", 2, stated=TRUE_MASS)]
    judges = [
        recorded(robot, "judge", 3, use="validate", spoilt=1.4),
        recorded(robot, "judge_loaded", 4, stated=0.5 * TRUE_MASS, use="validate"),
    ]
    alone, beside = masses(motions)[1], masses([*motions, *judges])[1]
    assert [g.value for g in beside] == [g.value for g in alone]
    np.testing.assert_allclose([g.value for g in alone], GAINS[1:], rtol=0.05)


def test_a_held_out_payload_is_weighed_by_gains_that_it_had_no_part_in():
    robot = arm(joints=2)
    motions = [
        recorded(robot, "empty", 1),
        recorded(robot, "loaded", 2, stated=TRUE_MASS),
        recorded(robot, "judge", 3, stated=0.5 * TRUE_MASS, use="validate"),
    ]
    found = masses(motions)[0]
    assert found["judge"].mass.value == pytest.approx(TRUE_MASS, rel=0.03)
    assert found["judge"].error == pytest.approx(100.0, abs=6.0)


def test_a_mass_that_set_the_gains_is_not_compared_with_what_was_stated():
    robot = arm(joints=2)
    found = masses([recorded(robot, "empty", 1), recorded(robot, "loaded", 2, stated=TRUE_MASS)])[0]
    assert np.isnan(found["loaded"].error)
    (said,) = report_payload(SimpleNamespace(payloads=tuple(found.values())))
    assert said.kind == "note"
    assert "used to estimate the gains of the drives, so that it cannot test them" in said.text
    assert "estimated payload" not in said.text


def test_each_of_several_masses_that_set_the_gains_is_judged_by_the_others():
    robot = arm(joints=2)
    motions = [
        recorded(robot, "empty", 1),
        recorded(robot, "right", 2, stated=TRUE_MASS),
        recorded(robot, "wrong", 3, stated=1.2 * TRUE_MASS),
    ]
    found = masses(motions)[0]
    # Each is weighed in the other's kilograms.
    assert found["wrong"].mass.value == pytest.approx(TRUE_MASS, rel=0.03)
    assert found["right"].mass.value == pytest.approx(1.2 * TRUE_MASS, rel=0.03)
    texts = [said.text for said in report_payload(SimpleNamespace(payloads=tuple(found.values())))]
    assert all("with gains from the other payloads" in text for text in texts)


def test_payloads_on_two_links_do_not_set_gains_together():
    robot = arm(joints=2)
    upper = recorded(robot, "upper", 3, stated=TRUE_MASS)
    upper = replace(upper, payload=PayloadSpec(mass="1.5 kg", link="upper"))
    with pytest.raises(IdentificationError, match="found payloads on the links upper and lower, expected"):
        masses([recorded(robot, "empty", 1), upper, recorded(robot, "loaded", 2, stated=TRUE_MASS)])
