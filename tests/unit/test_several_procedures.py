"""A study that asks one command for several procedures gets all of them, saved together."""

import json
from dataclasses import dataclass, replace

import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid._errors import IdentificationError, PellucidError
from pellucid.cli import app
from pellucid.models.estimates import Parameter, Verdict
from pellucid.models.parameter_card import ParameterCard
from pellucid.study.pages.page import Page, Section
from pellucid.study.procedures import registry
from pellucid.study.procedures.procedure import Procedure, quiet
from pellucid.study.procedures.result import ParameterTable, Result
from pellucid.study.procedures.run import RUN_COSTS, run
from pellucid.study.results import ResultRow, read_rows


@dataclass(frozen=True)
class Backlash(Procedure):
    """A second thing that `identify` could find of a joint."""

    name, command = "backlash", "identify"

    def asked(self, study):
        return True

    def faults(self, study, table):
        return []

    def run(self, study, table, tell=quiet, **options):
        assert not options
        tell("looking for backlash", 0.5)
        gap = Parameter("gap", "rad", 0.01, 0.001)
        return Result(
            study=study.name,
            headline="the gear has play",
            tables=(ParameterTable("Backlash", (gap,)),),
            verdicts=(Verdict("wrong", "The gear has play."),),
            rows=(ResultRow(f"{study.name}.backlash.gap", 0.01, "rad", "identify", "fitted"),),
            cards={"backlash": ParameterCard("backlash", study.name, "backlash", ())},
            checksums={"other": "ab" * 32},
        )

    def page(self, study, result):
        return Page("Backlash", "Study", headline=result.headline, sections=(Section("backlash", "Backlash"),))


@pytest.fixture
def both(make_study, monkeypatch):
    monkeypatch.setattr(registry, "ALL_PROCEDURES", (*registry.ALL_PROCEDURES, Backlash()))
    return make_study()


def test_all_run_and_one_result_has_what_each_found(both):
    heard = []
    found = pl.identify(
        both, families=["symmetric"], thorough=False, on_progress=lambda text, share: heard.append((text, share))
    )
    assert [part.procedure for part in found.parts] == ["joint", "backlash"]
    assert found["inertia"].value == found.parts[0]["inertia"].value
    assert found["gap"].value == 0.01
    assert "play" in found.headline
    assert found.verdicts[0].text == "The gear has play."  # the worst first
    shares = [share for _, share in heard]
    assert shares == sorted(shares)
    # Half of all procedures, after the share of reading, and half of what follows.
    backlash = 0.5 * (1.0 + RUN_COSTS["reading recordings"] + 0.5 * RUN_COSTS["fitting"])
    assert dict(heard)["looking for backlash"] == pytest.approx(backlash)
    assert shares[-1] == 1.0


def test_what_all_found_is_saved_and_drawn_together(both):
    found = pl.identify(both, families=["symmetric"], thorough=False)
    found.save(both)
    rows = {row.id for row in read_rows(both.results_path)}
    assert {"bench.symmetric.inertia", "bench.backlash.gap"} <= rows
    assert json.loads((both.models_dir / "joint.json").read_text())["family"] == "symmetric"
    assert (both.models_dir / "backlash.json").is_file()
    assert all(both.kept_path(name).is_file() for name in ("joint", "backlash"))
    assert "the gear has play" in pl.report(both, found).read_text(encoding="utf-8").lower()


def test_the_command_prints_and_saves_all(both):
    made = CliRunner().invoke(app, ["identify", str(both.folder)])
    assert made.exit_code == 1  # a finding says that the gear has play
    assert "inertia" in made.stdout
    assert "the gear has play" in made.stdout.lower()
    assert "bench.backlash.gap" in {row.id for row in read_rows(both.results_path)}


def test_families_are_of_a_joint_alone(both, monkeypatch):
    monkeypatch.setattr(registry, "ALL_PROCEDURES", (Backlash(),))
    with pytest.raises(IdentificationError, match="omit --family"):
        pl.identify(both, families=["symmetric"])


def test_where_one_runs_its_own_result_is_returned(make_study):
    from pellucid.joint.study.joint_result import JointResult

    found = pl.identify(make_study(), families=["symmetric"], thorough=False)
    assert type(found) is JointResult
    assert found.each == (found,)


class Play(Backlash):
    """The same of a command of its own."""

    name, command = "play", "play"

    def run(self, study, table, tell=quiet, **options):
        found = super().run(study, table, tell, **options)
        return replace(found, rows=tuple(replace(row, command=self.command) for row in found.rows))


def test_one_function_runs_all_or_one_by_its_name(make_study, monkeypatch):
    monkeypatch.setattr(registry, "ALL_PROCEDURES", (*registry.ALL_PROCEDURES, Play()))
    study, quick = make_study(), {"families": ["symmetric"], "thorough": False}
    found = run(study, joint=quick)
    assert [part.procedure for part in found.parts] == ["joint", "play"]
    found.save(study)
    commands = {row.id: row.command for row in read_rows(study.results_path)}
    assert (commands["bench.symmetric.inertia"], commands["bench.backlash.gap"]) == ("identify", "play")
    assert run(study, "play").procedure == "play"
    assert run(study, "joint", joint=quick)["inertia"].value == found["inertia"].value
    with pytest.raises(PellucidError, match="run: found 'jiont', expected a procedure or a command: identify, joint"):
        run(study, "jiont")
    with pytest.raises(PellucidError, match="run: found options of jiont"):
        run(study, jiont=quick)
    with pytest.raises(IdentificationError, match=r"no table \[hinge\], so that hinge does not apply"):
        run(study, "hinge")
