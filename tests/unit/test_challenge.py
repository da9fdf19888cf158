"""The generator of the challenge: it knows nothing of the analysis, and its truth is what its scenarios say."""

import csv
from pathlib import Path

import numpy as np
from research.certificate import generator
from research.certificate.scenarios import SCENARIOS

ROOT = Path(__file__).parents[2]


def test_the_generator_imports_nothing_of_pellucid():
    for path in (ROOT / "research" / "certificate").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert "import pellucid" not in text, path.name
        assert "from pellucid" not in text, path.name


def test_truths_are_those_of_the_scenarios(monkeypatch):
    monkeypatch.setattr(generator, "POPULATION", 300)
    found = {own.name: generator.truth_of(i) for i, own in enumerate(SCENARIOS)}
    margin = np.log1p(0.10)
    for own in SCENARIOS:
        at = found[own.name].change
        if not own.backwards:
            assert abs(at) == np.float64(own.change) * margin
        assert found[own.name].transparent == (
            own.change < 0.9 and own.spread < 0.9 and not own.growth and own.corrected[0] == own.corrected[1]
        )
    assert found["corrections backwards with the robot"].change > 4.0 * margin


def test_a_study_is_files_without_its_truth(tmp_path):
    for i in (0, len(SCENARIOS)):
        folder = tmp_path / str(i)
        folder.mkdir()
        generator.write_study(i, folder)
        again = tmp_path / f"{i} again"
        again.mkdir()
        generator.write_study(i, again)
        for path in folder.iterdir():
            assert path.read_bytes() == (again / path.name).read_bytes()
    with (tmp_path / "0" / "movements.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    people = generator.truth_of(0).people
    assert head == ["participant", "condition", "trial", "amplitude", "direction", "duration"]
    assert len(rows) == people * 2 * 6 * generator.REPETITIONS * 4
    assert (tmp_path / str(len(SCENARIOS)) / "study.toml").exists()
