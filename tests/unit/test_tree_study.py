"""An arm of two joints from its recordings to its page: what was put in is found, written, shown and compared."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_arm import COULOMB, LOAD, VISCOUS, arm_study

import pellucid as pl
from pellucid.arm.study import tree_findings, tree_page
from pellucid.arm.study.tree_result import MODEL_DESCRIPTIONS, in_drive_units
from pellucid.models.estimates import Parameter, Verdict
from pellucid.models.tree_card import read_tree_card
from pellucid.study.cause_words import cause_sentence
from pellucid.study.procedures.compare import compare
from pellucid.study.procedures.findings import SECOND_RECORDING_TEXT


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """One recording to be fitted, one to be judged by, one with a payload of 1.2 kg."""
    return pl.open(arm_study(tmp_path_factory.mktemp("tree") / "arm", payload=1.2))


@pytest.fixture(scope="module")
def found(study):
    told = []
    result = pl.identify(study, on_progress=lambda text, share: told.append((text, share)))
    assert [share for _, share in told] == sorted(share for _, share in told)
    result.save(study)
    return result


@pytest.fixture(scope="module")
def written(study, found):
    return pl.report(study, found).read_text(encoding="utf-8")


def test_friction_is_found(found):
    for k, joint in enumerate(("shoulder", "elbow")):
        assert found[f"{joint}.viscous"].value == pytest.approx(VISCOUS[k], rel=0.08)
        assert found[f"{joint}.coulomb"].value == pytest.approx(COULOMB[k], rel=0.12)
    assert found["shoulder.load"].value == pytest.approx(LOAD[0], abs=0.03)
    assert "load" in found.best.families[0]


def test_the_payload_is_found(found):
    (payload,) = found.payloads
    assert payload.mass.value == pytest.approx(1.2, rel=0.05) or payload.mass.refused


def test_errors_have_their_rows(study, found):
    rows = {row["id"]: row for row in json.loads(study.results_path.read_text())["figures"]}
    for judged in ("fitted", "segments_out", "heldout"):
        for model in ("stated", "base", "best", "consistent"):
            each = [rows[f"arm.{model}.{judged}.error.joint_{k}"]["value"] for k in (1, 2)]
            assert rows[f"arm.{model}.{judged}.error.mean"]["value"] == pytest.approx(np.mean(each))
    assert rows["arm.best.heldout.error.mean"]["value"] < rows["arm.base.heldout.error.mean"]["value"]
    assert rows["arm.best.heldout.error.mean"]["unit"] == "%"
    assert rows["arm.best.heldout.error.mean"]["split"] == "heldout"
    assert rows["arm.consistent.heldout.loss"]["value"] < 0.3
    assert rows["arm.base.parameters.rigid"]["value"] >= 4


def test_cards_are_read_again_and_make_the_same_effort(study, found):
    motion = found.traces[0]
    for name in ("base", "best", "consistent"):
        card = read_tree_card(study.models_dir / f"tree.{name}.json")
        assert card.names == ("shoulder", "elbow")
        assert card.heldout_error == found.errors_of(name, "heldout").each
    card = read_tree_card(study.models_dir / "tree.best.json")
    rows = np.flatnonzero(motion.moving.all(axis=1))[:200]
    still = np.zeros((len(rows), 2))
    np.testing.assert_allclose(
        card.driven(1e-3).motor_effort(motion.position[rows], still, still),
        found.best.load(_at(motion, rows)) + card_offset(card),
        atol=1e-9,
    )


def _at(motion, rows):
    class Rows:
        position, velocity, acceleration = (
            motion.position[rows],
            0.0 * motion.velocity[rows],
            0.0 * motion.velocity[rows],
        )

    return Rows


def card_offset(card):
    return np.array(card.joints)[:, 0]


def test_the_page_has_the_moving_arm_first_and_no_script(written):
    assert "<script" not in written
    assert written.index('id="fig-arm"') < written.index('id="fig-effort"')
    assert written.count("<animate ") >= 4
    assert "prefers-reduced-motion" in written
    for figure in ("arm", "effort", "friction", "friction-load", "shown", "intervals"):
        assert f'id="fig-{figure}"' in written
    words = re.sub(r"<[^>]*>", " ", re.sub(r"<(style|svg).*?</\1>", "", written, flags=re.DOTALL))
    assert "nan" not in words.lower().split()


def test_the_saved_picture_moves_and_rests(study, written):
    text = (study.report_dir / "arm.svg").read_text()
    frames = re.search(r'<animate attributeName="d" dur="([\d.]+)s"[^>]*values="([^"]*)"', text)
    assert 5.0 < float(frames[1]) < 20.0
    poses = frames[2].split(";")
    assert len({len(re.findall("[ML]", pose)) for pose in poses}) == 1
    assert len(set(poses)) > 50
    # The one at rest is the first of those that move.
    still = re.search(r'<g class="rests" id="arm-links">\s*<path d="([^"]*)"', text)[1]
    np.testing.assert_allclose(_numbers(still), _numbers(poses[0]), atol=0.06)


def _numbers(path):
    return [float(x) for x in re.findall(r"-?\d+\.?\d*", path)]


def test_a_kept_result_draws_the_same_page(study, written):
    assert pl.report(study).read_text(encoding="utf-8") == written


def test_a_terminal_and_a_notebook_show_it(found):
    text = str(found)
    assert "shoulder" in text
    assert MODEL_DESCRIPTIONS["best"] in text
    assert max(map(len, text.splitlines())) <= 100
    html = found._repr_html_()
    assert html.count("<table>") == len(found.tables)


def test_each_joint_has_an_answer_in_every_output(study, found):
    assert [(each.name, each.verdict) for each in found.joint_answers] == [("shoulder", "yes"), ("elbow", "yes")]
    rows = {row.id: row for row in found.rows}
    row = rows[f"{found.study}.best.predicts.joint_2"]
    assert row.value == 1.0
    assert row.note.startswith("elbow: yes: ")
    assert found.answer.verdict == "yes"
    (table,) = (t for t in found.tables if t.title.startswith("Prediction of each joint"))
    assert table.rows[0][:2] == ("shoulder", "yes")
    assert "effort error" in table.rows[0][2]
    weak = Verdict("warning", "3 are not identifiable.", "Record faster motion.", finding="weak_numbers")
    record, confirm, *_, export = replace(found, verdicts=(weak,)).make_answer().next
    assert record.text == "Before a controller is used, record faster motion (3 are not identifiable)"
    assert confirm.text == SECOND_RECORDING_TEXT
    assert export.name == "export"
    # Export was the only step, although no recording was held out and a cause was known.
    crossed = replace(found, errors=tuple(e for e in found.errors if e.judged != "heldout")).make_answer()
    assert crossed.verdict == "yes"
    assert crossed.next[0].text.startswith("Record a second motion and hold it out")
    assert crossed.next[-1].name == "export"
    resting = replace(found, traces=tuple(replace(t, moving=t.moving * [1, 0]) for t in found.traces))
    assert resting.joint_answers[1].verdict == "cannot say"
    assert "in only " in resting.joint_answers[1].reason
    page = tree_page.page(study, found)
    (effort,) = next(section.drawings for section in page.sections if section.id == "effort")
    assert ": measured, predicted where" in effort.caption
    simulated = replace(study, config=study.config.model_copy(update={"simulated": True}))
    (effort,) = next(s.drawings for s in tree_page.page(simulated, found).sections if s.id == "effort")
    assert "measured" not in effort.caption + effort.svg
    assert any(section.id == "joints" and section.tables for section in page.sections)
    assert "The model predicts 2 of 2 joints" in page.said


@pytest.mark.parametrize(("gain", "unit"), [(None, "N*m/rad"), (2.0, "A/rad")])
def test_a_spring_at_a_joint_is_a_cause_in_every_output(tmp_path, gain, unit):
    """It exceeds the elbow's gravity, which must not look like an effort of the other sign."""
    study = pl.open(arm_study(tmp_path / "arm", spring=4.0, gain=gain))
    found = pl.identify(study)
    (cause,) = found.causes
    assert (cause.name, cause.joint, cause.unit) == ("parallel_spring", "elbow", unit)
    assert cause.size == found["elbow.parallel_stiffness"].value == pytest.approx(4.0 / (gain or 1.0), rel=0.03)
    rows = {row.id: row for row in found.rows}
    row = rows[f"{found.study}.cause.elbow.parallel_spring"]
    assert (row.value, row.unit, row.note) == (cause.size, cause.unit, cause_sentence(cause))
    assert rows[f"{found.study}.cause.elbow.parallel_spring.share"].value == cause.share
    assert row.note.startswith("At elbow, a parallel spring of ")
    assert row.note in [verdict.text for verdict in found.verdicts]
    said = " ".join(str(found).split())
    assert row.note in said
    assert "At elbow, a parallel spring of " in pl.report(study, found).read_text(encoding="utf-8")
    assert found.fit.causes == found.causes
    # Cards have no springs: the offset is the mean effort of what the card lacks.
    position = np.concatenate([t.position[:, 1] for t in found.traces if t.use == "fit"])
    offset = found["elbow.offset"].value + cause.size * position.mean()
    assert found.cards["tree.best"].joint_columns["offset"][1] == pytest.approx(offset)
    assert any("spring of elbow is not in this card" in note for note in found.cards["tree.best"].notes)
    assert [answer.verdict for answer in found.joint_answers] == ["yes", "yes"]


def test_recorded_friction_is_what_the_effort_has_beside_bodies(found):
    """The low-pass of the effort rounds friction where a joint turns. The page draws no sharp friction there."""
    for k, curve in enumerate(tree_page._curves(found)):
        effort, load, moving = (
            np.concatenate([getattr(t, name) for t in found.traces if t.use == "fit"])
            for name in ("effort", "load", "moving")
        )
        rows = moving[:, k].astype(bool)
        beside = (effort - load)[rows, k]
        np.testing.assert_allclose(curve.measured, beside[:: max(1, len(beside) // tree_page.MAX_DRAWN_ROWS)])


def test_a_plain_arm_has_no_cause(found):
    assert found.causes == ()


def test_a_result_predicts_simulates_and_scores(found):
    trace = next(t for t in found.traces if t.use == "validate")
    recording = {"time": trace.time, "position": trace.position, "effort": trace.effort}
    predicted = found.predict(trace.time, trace.position)
    assert predicted.shape == trace.position.shape
    assert found.score(recording).mean_error < 20.0
    made = found.simulate(trace.time[:200], predicted[:200], trace.position[0], trace.velocity[0])
    assert np.isfinite(made.position).all()
    assert found.fit.consistent is found.models["consistent"]


def test_two_identifications_are_compared(study, found):
    compared = compare(study.folder, study.folder)
    assert not any(row.changed for row in compared.rows)
    assert "shoulder.viscous" in {row.name for row in compared.rows}


def test_one_recording_alone_is_judged_by_segments(tmp_path):
    folder = arm_study(tmp_path / "arm", validate=False, gain=2.5)
    result = pl.identify(pl.open(folder))
    assert result.errors_of("consistent", "segments_out").mean < 1.05 * result.errors_of("best", "segments_out").mean
    assert result.judged == "segments_out"
    assert result.effort_units == ("A", "A")
    assert result["elbow.coulomb"].value == pytest.approx(COULOMB[1] / 2.5, rel=0.15)
    assert any(v.finding == "unknown_gain" for v in result.verdicts)


URDF = """<robot name="arm"><link name="base"/><link name="upper"/><link name="lower"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.3"/>
<axis xyz="0 1 0"/></joint></robot>"""


def test_stand_ins_for_bodies_are_no_rival(tmp_path):
    folder = arm_study(tmp_path / "arm", validate=False)
    (folder / "arm.urdf").write_text(URDF)
    text = re.sub("^(place|axis|body) = .*\n", "", (folder / "study.toml").read_text(), flags=re.MULTILINE)
    text = text.replace('families = ["load"]', 'urdf = "arm.urdf"\nfamilies = []').replace(
        "segments = 7", "segments = 2"
    )
    (folder / "study.toml").write_text(text)
    result = pl.identify(pl.open(folder))
    assert {error.model for error in result.errors} == {"base", "best", "consistent"}
    # The answer may say that the origin of the data is not stated.
    assert not re.search("(?<!not )stated", str(result))


def test_a_sign_in_doubt_is_told(found):
    assert list(tree_findings.report_sign_in_doubt(found)) == []
    doubted = replace(found, doubts=("1.02 times as much, expected less: try the other sign",))
    (told,) = tree_findings.report_sign_in_doubt(doubted)
    assert told.text == "A sign may be wrong: 1.02 times as much, expected less: try the other sign."


def test_what_a_bound_holds_is_named_after_its_joint():
    held = Parameter("joint_1.coulomb", "N*m", 0.0, 0.1, at_bound=True)
    case = SimpleNamespace(best=SimpleNamespace(parameters={held.name: held}))
    (told,) = tree_findings.report_held_by_a_bound(case)
    assert told.text.startswith("On a physical bound: coulomb of joint 1.")


def test_parameters_have_the_drives_unit_where_no_gain_is_known(found):
    """Friction by a motor's current stood in N*m*s/rad, with a gain of 1 N*m/A that nobody had stated."""
    model = in_drive_units(found.best, ("A", "A"))
    units = {p.unit for p in model.parameters.values()}
    assert not [unit for unit in units if "N" in unit or "kg" in unit]
    assert model.parameters["shoulder.viscous"].unit == "A*s/rad"
    assert model.parameters["shoulder.coulomb"].unit == "A"
    assert model.parameters["shoulder.viscous"].value == found["shoulder.viscous"].value
    assert in_drive_units(found.best, ("N*m", "N*m")) is found.best
    mixed = in_drive_units(found.best, ("N*m", "A"))
    assert mixed.parameters["elbow.coulomb"].unit == "A"
    assert mixed.parameters["shoulder.coulomb"].unit == "N*m"
