"""The four-joint chapter's rows and page, from figures that are made up; one joint's comparison in earnest."""

import numpy as np

from pellucid_lab.arm.rig import able_arm
from pellucid_lab.papers.able.arm_chapter import MODEL_IDS, ArmChapter, arm_rows, arm_sections
from pellucid_lab.papers.able.arm_identification import IdentifiedArm, add_payload, directional, draw_test_motions
from pellucid_lab.papers.able.arm_worn import BEST_LAW, LAWS, PUBLISHED_LAW
from pellucid_lab.papers.able.directional_sets import DirectionalRow


def made_up(n, model):
    return DirectionalRow(n, model, 7 * n, 7 * n, 2, 2, (1.0,) * n, 20.0, 30.0, 0.0, 0.9)


def test_rows_and_page_say_the_same_of_every_model():
    compared = {n: {name: made_up(n, model) for model, name in MODEL_IDS.items()} for n in (1, 4)}
    found = IdentifiedArm("able-arm", 1, {}, {"consistent": 1.2, "load_stated_gains": 1.7}, 0.0, {}, "people",
                          np.ones(4), None, None)  # fmt: skip
    chapter = ArmChapter(compared, found, {PUBLISHED_LAW: 0.8, "transparent": 0.7, BEST_LAW: 0.6})
    rows = {row.id: row for row in arm_rows(chapter)}
    assert rows["able.arm.n4.load.parameters"].ours == 28
    assert rows["able.arm.table1.ratio"].ours == 1.0
    assert rows["able.arm.torque.best_over_fc"].ours == 0.6 / 0.8
    assert all(name.startswith("able.arm.") for name in rows)
    sections = arm_sections(chapter)
    assert "28 parameters" in sections[0].paragraphs[0]
    assert sections[0].drawings[0].svg.startswith("<?xml")


def test_fewer_joints_are_compared_with_the_others_held():
    quick = able_arm().changed({"protocol.repetitions": 1, "protocol.duration": 10.0})
    found = {MODEL_IDS[row.model]: row for row in directional(quick, 1, 1, 1)}
    assert found["load"].parameters < found["sets_own"].parameters
    assert found["load"].mean < 5.0


def test_a_payload_adds_its_mass_and_judges_are_not_longer_than_asked():
    rig = able_arm()
    assert add_payload(rig)["link"]["carriage"]["mass"] == rig["link"]["carriage"]["mass"] + 1.5
    said, trials = draw_test_motions(rig, 1)
    assert said in ("people", "generated reaching")
    assert all(len(t.reference) <= 40_000 and t.use == "validate" for t in trials)
    assert {BEST_LAW, PUBLISHED_LAW} < set(LAWS)
