"""A study with [transfer_function]: what is fitted, held out, refused and written down."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError, PellucidError
from pellucid.controllers.export.export import export
from pellucid.models.parameter_card import read_parameter_card
from pellucid.orthosis.transfer_function import TransferFunction
from pellucid.study.procedures.compare import compare
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify
from pellucid.study.procedures.run import report as write_report

HEAD = """
name = "joint"
[rig]
motion = "rotary"
[channels]
time = { column = "t", unit = "s" }
torque = { column = "u", unit = "N*m" }
position = { column = "q", unit = "rad" }
[transfer_function]
poles = 2
"""
"""Of a study whose input is a torque; keys of the last table may follow."""


def study_of(folder, records: dict[str, tuple[str, np.ndarray]]):
    """A study of (use, table with time, torque, position) by recording."""
    folder.mkdir()
    text = HEAD + 'hold = "zero"\n'
    for name, (use, table) in records.items():
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t,u,q", comments="")
        text += f'[[recordings]]\nname = "{name}"\nfile = "{name}.csv"\nuse = "{use}"\n'
    (folder / "study.toml").write_text(text)
    return open_study(folder)


def table(seed: int = 0, n: int = 900) -> np.ndarray:
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 50.0
    u = np.repeat(rng.normal(size=n // 30), 30)
    y = TransferFunction([20.0], [1.0, 2.0, 30.0]).simulate(time, u, hold="zero", initial=[0.1, 0.0])
    return np.column_stack([time, u, y + 0.01 * rng.normal(size=n)])


@pytest.mark.slow
def test_recordings_are_fitted_and_others_judged_with_what_they_gave(tmp_path):
    study = study_of(tmp_path / "s", {"a": ("fit", table(0)), "b": ("fit", table(1)), "c": ("validate", table(2))})
    found = identify(study)
    found.save(study)
    values = {r.id: (r.value, r.split) for r in found.rows}
    assert values["joint.transfer_function.fit.a"][0] > 90.0
    assert values["joint.transfer_function.fit.c"] == (found.heldout["c"].fit, "heldout")
    assert found.heldout["c"].fit > 90.0
    assert set(found.fits) == {"a", "b", "a+b"}
    assert values["joint.transfer_function.inertia.a"][0] == pytest.approx(1 / 20, rel=0.05)
    card = read_parameter_card(study.models_dir / "transfer_function.a+b.json")
    assert card.values["a0"] == found.fits["a+b"]["a0"].value
    assert card.settings["hold"] == "zero"
    assert write_report(study, found).is_file()


def test_what_cannot_be_fitted_is_refused_with_its_reason_and_the_rest_goes_on(tmp_path):
    frozen, short, unsorted = table(1), table(2)[:15], table(3)
    frozen[:, 1] = 0.5
    unsorted[400:, 0] -= 100.0
    study = study_of(
        tmp_path / "s",
        {"good": ("fit", table(0)), "frozen": ("fit", frozen), "short": ("fit", short), "stale": ("fit", unsorted)},
    )
    found = identify(study)
    rows = {r.id: r for r in found.rows}
    assert rows["joint.transfer_function.fit.good"].value > 90.0
    assert rows["joint.transfer_function.fit.frozen"].value is None
    assert "input that stays at 0.5" in rows["joint.transfer_function.fit.frozen"].note
    assert "found 15 samples" in rows["joint.transfer_function.fit.short"].note
    assert rows["joint.transfer_function.fit.stale"].value > 90.0
    assert "400 samples of the others excluded" in rows["joint.transfer_function.fit.stale"].note
    assert set(found.refused) == {"frozen", "short"}
    refused = [f.message for f in check(study) if f.severity == "refuse"]
    assert [message.split(":")[0] for message in refused] == [
        "frozen.csv (recording frozen), channel torque",
        "short.csv (recording short), channel position",
    ]


def test_a_study_without_a_recording_that_fits_is_refused(tmp_path):
    frozen = table()
    frozen[:, 1] = 0.0
    with pytest.raises(IdentificationError, match="no recording can be fitted"):
        identify(study_of(tmp_path / "s", {"frozen": ("fit", frozen)}))


def test_a_comparison_does_not_advise_a_command_that_makes_no_card_to_compare(tmp_path):
    """It said "make it with: pellucid identify", also after that command."""
    study = study_of(tmp_path / "s", {"a": ("fit", table(0))})
    with pytest.raises(PellucidError, match="study of transfer function, expected one that identifies a joint") as told:
        compare(study.folder, study.folder)
    assert "pellucid identify" not in str(told.value)
    study.models_dir.mkdir()
    (study.models_dir / "transfer_function.a.json").write_text("{}")
    with pytest.raises(PellucidError, match=r"no such model card; found transfer_function\.a\.json") as told:
        export(study)
    assert "pellucid identify" not in str(told.value)
