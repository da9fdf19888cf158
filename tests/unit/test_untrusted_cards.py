"""A stranger's card: types, ranges and words are those that an identification writes, or it is refused by name."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from research.evidence._mutations import damaged_json

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.controllers.export.export import values_for
from pellucid.models.card import read_card
from pellucid.models.parameter_card import read_parameter_card
from pellucid.models.slider_joint import read_slider_card
from pellucid.study.procedures.registry import open_study

OLD = Path(__file__).parents[1] / "data" / "5239fe4" / "commands"
EACH = int(os.environ.get("FUZZ", "300"))
CARDS = {"bench/models/joint.json": read_card, "slider/models/slider.load.json": read_slider_card,
         "knee/models/S1.coupling.json": read_parameter_card, "knee/models/orthosis.json": read_parameter_card,
         "leg/models/torque_map_knee.json": read_parameter_card}  # fmt: skip


@pytest.fixture
def joint(tmp_path):
    """A copy of a joint's card, changed at some paths and read again."""

    def read(*changes):
        table = json.loads((OLD / "bench/models/joint.json").read_text())
        for path, value in changes:
            *parts, key = path.split(".")
            node = table
            for part in parts:
                node = node[int(part) if isinstance(node, list) else part]
            node[int(key) if isinstance(node, list) else key] = value
        (tmp_path / "joint.json").write_text(json.dumps(table))
        return read_card(tmp_path / "joint.json")

    return read


@pytest.mark.parametrize("card", CARDS)
def test_what_pellucid_wrote_is_read(card):
    assert CARDS[card](OLD / card).parameters


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("motion", "sideways", "found the motion 'sideways', expected one of rotary, prismatic"),
        ("effort_unit", "N*m */ system(1); /*", "found the effort_unit"),
        ("parameters.0.value", 1e30, "found 1e\\+30"),
        ("parameters.0.value", -1.0, "a value within its interval"),
        ("parameters.0.value", "1.0", "value: found '1.0', expected a number"),
        ("parameters.0.value", True, "value: found True, expected a number"),
        ("parameters.0.value", 10**400, "expected a number"),
        ("parameters.0.value", float("nan"), "expected a number"),
        ("parameters.0.interval", [1.0, 0.0], "outside its interval|interval"),
        ("parameters.0.interval", [1.0], "found 1 entries, expected 2"),
        ("parameters.0.standard_error", -1.0, "standard error -1, expected 0 or more"),
        ("parameters.0.unit", "V", 'found the unit "V", expected "kg\\*m\\^2"'),
        ("parameters.0.name", "mass", "unknown parameters mass"),
        ("parameters.1.name", "inertia", "found the parameter 'inertia', expected a name, each once"),
        ("parameters", {}, "parameters: found {}, expected a list"),
        ("covariance", [[1.0]], "covariance: found 1 rows"),
        ("covariance.0.0", -1.0, "expected that of a covariance"),
        ("covariance.0.1", 1e3, "expected that of a covariance"),
        ("family", "$x$", "found the family"),
        ("velocity_range", -3.0, "velocity_range: found -3, expected 1e-09"),
        ("known", {"system": 1.0}, "unknown parameters system"),
        ("known", {"inertia": 1e30}, "inertia: found 1e\\+30"),
        ("known", [], "known: found \\[\\], expected an object"),
        ("confidence", 2.0, "confidence: found 2, expected above 0 and below 1"),
        ("checksums", {"sweep": "*/"}, "checksums: found '\\*/', expected 64 hexadecimal digits"),
        ("lifts", "a\u0000b", "lifts: found .* characters that can be seen"),
        ("joint", "../../x", "joint: found '../../x', expected letters"),
        ("extra", 1, "found the unknown key 'extra'"),
    ],
)
def test_what_no_identification_writes_is_refused(joint, path, value, message):
    with pytest.raises(PellucidError, match=message) as told:
        joint((path, value))
    assert "joint.json" in str(told.value)
    assert len(str(told.value)) < 1000


@pytest.mark.parametrize("card", CARDS)
def test_every_card_is_answered(tmp_path, card):
    text, path = (OLD / card).read_text(), tmp_path / Path(card).name
    accepted = refused = 0
    for seed in range(EACH // len(CARDS)):
        path.write_bytes(damaged_json(text, np.random.default_rng([seed, *card.encode()])))
        try:
            read = CARDS[card](path)
            assert all(np.isfinite(p.value) for p in read.parameters)
            accepted += 1
        except PellucidError:
            refused += 1
    assert accepted + refused == EACH // len(CARDS)
    assert refused


def test_no_card_breaks_what_is_made_of_it(tmp_path, make_study):
    """What a card makes is a controller's numbers, all of them finite, or a message."""
    study = open_study(make_study().folder, accept_stale=True)  # the card is of another study
    study.models_dir.mkdir()
    text = (OLD / "bench/models/joint.json").read_text()
    made = 0
    for seed in range(EACH // 3):
        (study.models_dir / "joint.json").write_bytes(damaged_json(text, np.random.default_rng([seed, 7])))
        try:
            made += bool(np.isfinite(list(values_for(study).numbers.values())).any())
            pl.compare(study.folder, study.folder, accept_stale=True)
        except PellucidError:
            continue
    assert made


def test_a_card_may_not_lie_elsewhere_or_be_a_device(make_study):
    study = make_study()
    study.models_dir.mkdir()
    (study.models_dir / "joint.json").symlink_to("/dev/zero")
    with pytest.raises(PellucidError, match="outside the study's folder"):
        values_for(study)
    with pytest.raises(PellucidError, match="found no regular file"):
        read_card(Path("/dev/zero"))
    shutil.copy(OLD / "bench/models/joint.json", study.models_dir / "other.json")
    with pytest.raises(PellucidError, match=r"other\.json: found an outdated card: its recordings"):
        values_for(open_study(study.folder), card="other.json")
    assert values_for(open_study(study.folder, accept_stale=True), card="other.json").numbers
