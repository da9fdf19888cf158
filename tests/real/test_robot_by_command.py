"""A real robot of six joints through `identify`: rows beside the simplest rivals, as its data's README states them."""

import json

import pytest

import pellucid as pl
from pellucid.models.tree_card import read_tree_card
from pellucid.study.datasets import init

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def staubli(data_folder, tmp_path_factory):
    if not (data_folder / "staubli_tx40").is_dir():
        pytest.skip(f"{data_folder / 'staubli_tx40'} is not here")
    study = init(tmp_path_factory.mktemp("staubli") / "study", "staubli_tx40")
    text = (study.folder / "study.toml").read_text()
    # Load friction alone is offered: what is judged here is the way to the rows, and not the search.
    (study.folder / "study.toml").write_text(
        text.replace("[tree] ", '[tree]\nfamilies = ["load"]\nripple = false\n#', 1)
    )
    study = pl.open(study.folder)
    result = pl.identify(study)
    result.save(study)
    return study, result, {row["id"]: row for row in json.loads(study.results_path.read_text())["figures"]}


def test_rivals_and_base_parameters_err_as_stated(staubli):
    _, _, rows = staubli
    for model, judged, stated in (
        ("published", "fitted", 10.0),
        ("stated", "fitted", 8.1),
        ("base", "fitted", 7.8),
        ("base", "segments_out", 8.9),
    ):
        row = rows[f"staubli_tx40.{model}.{judged}.error.mean"]
        assert row["value"] == pytest.approx(stated, abs=0.06)
        assert row["unit"] == "%"
    assert rows["staubli_tx40.base.parameters.rigid"]["value"] == 36
    assert rows["staubli_tx40.base.parameters.rotors"]["value"] == 4


def test_load_friction_is_found_and_bodies_cost_nothing(staubli):
    study, result, rows = staubli
    assert "load" in result.best.families[2]
    assert rows["staubli_tx40.best.segments_out.error.joint_3"]["value"] < 7.5
    assert rows["staubli_tx40.consistent.segments_out.loss"]["value"] <= 0.1
    assert rows["staubli_tx40.interval.over_jackknife.share_within_2"]["value"] >= 80.0
    card = read_tree_card(study.models_dir / "tree.consistent.json")
    assert card.consistent
    assert card.turns[5] == (0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
