"""What EMG tells of a force: correlations over people, and where it tells nothing."""

import numpy as np
import pytest
from made_emg import FS, raw_emg

from pellucid._errors import RecordingError
from pellucid.emg.study.emg_force.emg_force_table import EmgForceTable
from pellucid.emg.study.emg_force.find_emg_force import summarise_people
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import run

STUDY = """
name = "dynamometer"

[rig]
joint = "knee"
motion = "rotary"
lifts = "extension"

{people}
[channels]
time = {{ rate = "{rate} Hz" }}
emg.vastus = {{ column = "VL", unit = "mV" }}
emg.gastrocnemius = {{ column = "GL", unit = "mV" }}
force = {{ column = "force", unit = "N" }}

[emg_force]
agonists = {{ extension = "vastus", plantarflexion = "gastrocnemius" }}
"""


def study(folder, people=4, told=None, has_envelope=False):
    """People who push: vastus follows the force, and gastrocnemius does not, unless its envelope was recorded."""
    rng, names, text = np.random.default_rng(5), [f"P{i}" for i in range(people)], ""
    folder.mkdir()
    for name in names:
        for task in ("extension", "plantarflexion"):
            time = np.arange(round(6.0 * FS)) / FS
            effort = 0.1 + np.interp(time, np.linspace(0.0, 6.0, 7), rng.uniform(0.1, 1.0, 7))
            other = 0.1 + np.interp(time, np.linspace(0.0, 6.0, 13), rng.uniform(0.1, 1.0, 13))
            second = 40.0 * effort if has_envelope else 1e3 * raw_emg(4e-4 * other, rng)
            table = np.column_stack([1e3 * raw_emg(4e-4 * effort, rng), second, 200.0 * effort])
            np.savetxt(folder / f"{name}_{task}.csv", table, "%.8g", ",", header="VL,GL,force", comments="")
            text += (
                f'\n[[recordings]]\nname = "{name}_{task}"\nfile = "{name}_{task}.csv"\nparticipant = "{name}"\n'
                f'condition = "{task}"\n'
            )
    head = STUDY.format(people="".join(f"[participants.{n}]\n" for n in names), rate=FS)
    (folder / "study.toml").write_text((told or (lambda x: x))(head) + text, encoding="utf-8")
    return open_study(folder)


def test_muscles_that_follow_the_force_are_told_from_those_that_do_not(tmp_path):
    result = run(study(tmp_path / "s"), "emg_force")
    found = {(e.task, e.muscle): e for e in result.found}
    own, none = found["extension", "vastus"], found["plantarflexion", "gastrocnemius"]
    assert own.agonist
    assert none.agonist
    assert not found["extension", "gastrocnemius"].agonist
    assert own.answer == "follows the force"
    assert own.low < own.mean < own.high
    assert none.answer != "follows the force"
    assert len(own.each) == 4
    start = "Correlation of EMG and force, 4 people (95 % interval): 0.5 or more: vastus 0.9"
    assert result.headline.startswith(start)
    assert "; less than 0.5: gastrocnemius" in result.headline
    assert {r.id for r in result.rows} >= {"dynamometer.extension.vastus.r"}


def test_a_spoilt_envelope_decides_nothing_and_a_stated_one_does(tmp_path):
    """An envelope that was filtered as raw EMG said no, and the advised unit 1 was refused."""
    spoilt = run(study(tmp_path / "a", has_envelope=True), "emg_force")
    assert [each.verdict for each in spoilt.answer.parts] == ["yes", "cannot say"]
    assert "; an envelope, filtered as raw EMG: gastrocnemius." in spoilt.headline
    assert "use these envelopes for co-contraction and force" in spoilt.answer.next[0].text
    stated = study(
        tmp_path / "b", told=lambda x: x.replace('"GL", unit = "mV"', '"GL", unit = "1"'), has_envelope=True
    )
    found = run(stated, "emg_force")
    assert found.answer.verdict == "yes"
    own = next(each for each in found.found if each.agonist and each.muscle == "gastrocnemius")
    assert own.low > 0.98


def test_what_tells_little_is_said():
    table = EmgForceTable(agonists={"task": "muscle"})
    nothing = {f"P{i}": r for i, r in enumerate((0.1, -0.1, 0.05, 0.0, 0.08))}
    assert summarise_people("task", "muscle", table, nothing).answer == "tells little of the force"
    some = {f"P{i}": r for i, r in enumerate((0.5, 0.3, 0.4, 0.45))}
    assert summarise_people("task", "muscle", table, some).answer == "tells some of the force"
    unsure = {f"P{i}": r for i, r in enumerate((-0.2, 0.9, 0.5))}
    assert summarise_people("task", "muscle", table, unsure).answer == "cannot say"
    one = summarise_people("task", "muscle", table, {"P1": 0.99})
    assert (one.answer, one.low, one.high) == ("cannot say", -1.0, 1.0)


def test_a_task_without_its_muscle_or_force_is_refused(tmp_path):
    wrong = study(
        tmp_path / "a", 1, lambda x: x.replace('plantarflexion = "gastrocnemius"', 'lifting = "gastrocnemius"')
    )
    with pytest.raises(RecordingError, match="found the condition plantarflexion, expected one of extension, lifting"):
        run(wrong, "emg_force")
    wrong = study(tmp_path / "b", 1, lambda x: x.replace("[emg_force]", '[emg_force]\nforce = "torque"'))
    with pytest.raises(RecordingError, match="found no torque, expected the force"):
        run(wrong, "emg_force")
