"""What is kept comes back as it was, or not at all; nothing in the file can run."""

import json
import tracemalloc
from dataclasses import dataclass
from importlib.metadata import requires, version

import numpy as np
import pytest

from pellucid.files import kept_columns
from pellucid.files import kept_columns as keepers_mark
from pellucid.files.kept_columns import SEAL_LENGTH, mark, seal
from pellucid.models.estimates import Parameter, Verdict
from pellucid.study import code_fingerprint
from pellucid.study.kept import TREE_KEY, keep_result, read_kept
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.result import FigureTable, ParameterTable, Result
from pellucid.study.results import ResultRow


def result():
    parameter = Parameter("inertia", "kg*m^2", 0.05, 0.001, influence=0.5, bootstrap=(0.048, 0.052))
    return Result(
        study="a",
        headline="found",
        tables=(
            ParameterTable("Body", (parameter,)),
            FigureTable("Errors", ("what", "N*m"), (("torque", 0.2), ("-", None))),
        ),
        verdicts=(Verdict("note", "so it is"),),
        rows=(ResultRow("a.inertia", 0.05, "kg*m^2", "identify", "fitted"),),
        cards={},
        checksums={"one": "ab"},
    )


def test_a_result_comes_back_as_it_was(tmp_path):
    path = keep_result(tmp_path / "kept" / "joint.npz", "fresh", result())
    assert read_kept(path, "fresh") == result()
    assert read_kept(path, "stale") is None


def test_what_somebody_else_kept_is_not_believed(tmp_path, monkeypatch):
    path = keep_result(tmp_path / "a.npz", "fresh", result())
    own = read_kept(path, "fresh")
    monkeypatch.setenv(keepers_mark.SETTINGS_VARIABLE, str(tmp_path / "theirs"))
    assert read_kept(path, "fresh") is None
    theirs = keep_result(tmp_path / "b.npz", "fresh", result())
    assert read_kept(theirs, "fresh") == own
    monkeypatch.undo()
    assert read_kept(theirs, "fresh") is None
    np.savez(path, **dict(np.load(path)))  # the same numbers, without the mark
    assert read_kept(path, "fresh") is None


def test_a_key_is_drawn_once_and_nobody_else_may_read_it(tmp_path, monkeypatch):
    monkeypatch.setenv(keepers_mark.SETTINGS_VARIABLE, str(tmp_path / "mine"))
    first = mark(b"x")
    (key,) = (tmp_path / "mine").iterdir()
    assert len(key.read_bytes()) == 32
    assert key.stat().st_mode & 0o077 == 0
    keepers_mark._key.cache_clear()
    assert mark(b"x") == first
    key.write_bytes(b"short")  # as a full disk may leave it
    keepers_mark._key.cache_clear()
    assert mark(b"x") != first
    assert len(key.read_bytes()) == 32


def test_where_settings_cannot_be_written_a_key_lasts_as_long_as_the_process(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(keepers_mark.SETTINGS_VARIABLE, str(tmp_path / "file" / "below"))
    path = keep_result(tmp_path / "a.npz", "fresh", result())
    assert read_kept(path, "fresh") == result()
    keepers_mark._key.cache_clear()
    assert read_kept(path, "fresh") is None


@dataclass(frozen=True)
class Foreign:
    x: float


@pytest.mark.parametrize("x", [Foreign(1.0), np.array([object()], object), print, 1j])
def test_what_cannot_be_kept_is_not(tmp_path, x):
    path = keep_result(tmp_path / "a.npz", "fresh", result())
    assert keep_result(path, "fresh", {"x": x}) is None
    assert not path.exists()


@pytest.mark.parametrize(
    "x",
    [
        None, True, 3, 2.5, float("inf"), "text", (1, (2.0, "a")), [1, 2], {"a": 1, 2: "b", ("a", 1): None},
        frozenset({"a", "b"}), np.float64(2.5), slice(1, None),
    ],
)  # fmt: skip
def test_values_keep_their_kinds(tmp_path, x):
    back = read_kept(keep_result(tmp_path / "a.npz", "fresh", {"x": x}), "fresh")["x"]
    assert back == x
    assert type(back) is type(x)


def test_arrays_keep_bits_and_are_stored_once(tmp_path):
    x = np.random.default_rng(1).standard_normal((1000, 3))
    path = keep_result(
        tmp_path / "a.npz", "fresh", {"x": x, "again": x.copy(), "nan": np.array([np.nan, 1.0], np.float32)}
    )
    back = read_kept(path, "fresh")
    assert back["x"].tobytes() == x.tobytes() == back["again"].tobytes()
    assert back["nan"].dtype == np.float32
    assert path.stat().st_size < 1.5 * x.nbytes


def packed(path, tree):
    """A file with a tree of somebody's own, under this user's mark."""
    np.savez(path, **{TREE_KEY: np.frombuffer(tree.encode(), np.uint8)})
    path.write_bytes(path.read_bytes() + seal(path.read_bytes()))
    return path


@pytest.mark.parametrize(
    "kind",
    ["os:system", "builtins:eval", "pellucid.cli:main", "pellucid.models.estimates:nothing", "subprocess:Popen", ""],
)
def test_only_the_packages_own_dataclasses_are_made(tmp_path, kind):
    tree = json.dumps({"made_from": "fresh", TREE_KEY: {"d": kind, "v": {"args": "echo"}}})
    assert read_kept(packed(tmp_path / "a.npz", tree), "fresh") is None


def test_a_dataclass_whose_fields_are_others_is_none(tmp_path):
    verdict = {"d": "pellucid.models.estimates:Verdict", "v": {"kind": "good"}}
    tree = json.dumps({"made_from": "fresh", TREE_KEY: verdict})
    assert read_kept(packed(tmp_path / "a.npz", tree), "fresh") is None
    whole = {"d": "pellucid.models.estimates:Verdict", "v": vars(Verdict("a", "b"))}
    tree = json.dumps({"made_from": "fresh", TREE_KEY: whole})
    assert read_kept(packed(tmp_path / "a.npz", tree), "fresh") == Verdict("a", "b")


def test_a_damaged_file_is_none(tmp_path):
    path = keep_result(tmp_path / "a.npz", "fresh", result())
    whole = path.read_bytes()
    for cut in (0, 10, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:cut])
        assert read_kept(path, "fresh") is None
    path.write_bytes(b"x" + whole[1:])
    assert read_kept(path, "fresh") is None


def peak_memory(call):
    tracemalloc.start()
    try:
        assert call() is None
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("own_end", [False, True])
def test_a_large_file_of_somebody_else_is_not_read(tmp_path, own_end):
    """Neither one without a seal, nor one that ends in the seal of a smaller file of one's own."""
    path = tmp_path / "a.npz"
    end = keep_result(path, "fresh", result()).read_bytes()[-SEAL_LENGTH:] if own_end else b""
    with path.open("wb") as file:
        file.truncate(300_000_000)
        file.seek(0, 2)
        file.write(end)
    assert peak_memory(lambda: read_kept(path, "fresh")) < 1_000_000


def test_large_columns_of_somebody_else_are_not_read(tmp_path):
    path = tmp_path / "a.columns"
    with path.open("wb") as file:
        file.truncate(300_000_000)  # without any end of a line
    assert peak_memory(lambda: kept_columns._read_kept(path, tmp_path / "a.csv")) < 1_000_000


def test_another_core_and_other_libraries_make_another_fingerprint(tmp_path, monkeypatch):
    def fingerprint():
        code_fingerprint.code_fingerprint.cache_clear()
        return code_fingerprint.code_fingerprint()

    before = fingerprint()
    assert fingerprint() == before
    monkeypatch.setattr(
        code_fingerprint, "installed_version", lambda name: "0" if name == "scipy" else version(name)
    )
    assert fingerprint() != before
    monkeypatch.undo()
    found = code_fingerprint._source_file
    core = found("pellucid._core")
    other = tmp_path / core.name
    other.write_bytes(core.read_bytes() + b"\0")
    monkeypatch.setattr(
        code_fingerprint, "_source_file", lambda name: other if name == "pellucid._core" else found(name)
    )
    assert fingerprint() != before
    monkeypatch.undo()
    assert fingerprint() == before
    assert {"numpy", "scipy", "scikit-learn"} <= set(code_fingerprint.library_versions())
    assert {"emcee", "statsmodels"} <= set(code_fingerprint.library_versions())
    assert not {"pytest", "ruff", "pellucid", "pandas", "mcap"} & set(code_fingerprint.library_versions())
    assert code_fingerprint.library_versions()["numpy"] == version("numpy")


def test_an_extra_that_computes_nothing_leaves_results_up_to_date(monkeypatch):
    before = code_fingerprint.library_versions()
    extras = ["mkdocs-material>=9.5; extra == 'site'", 'pylsl>=1.18.1 ; extra == "live"']
    monkeypatch.setattr(code_fingerprint, "requires", lambda name: [*requires(name), *extras])
    monkeypatch.setattr(code_fingerprint, "installed_version", lambda name: "1" if "mkdocs" in name else version(name))
    assert code_fingerprint.library_versions() == before


def test_a_result_is_a_table_of_parameters():
    found = result()
    assert found["inertia"].value == 0.05
    assert "inertia" in found
    assert list(found) == ["inertia", "Body.inertia"]
    with pytest.raises(KeyError, match="'mass'; found here: inertia"):
        found["mass"]
    assert "so it is" in str(found)
    assert "inertia" in str(found)
    assert found._repr_html_().count("<table") == 2


def test_a_fingerprint_sees_cards_written_anew_and_files_that_lie_elsewhere(make_study, tmp_path):
    study = make_study()
    card = tmp_path / "elsewhere" / "card.json"
    card.parent.mkdir()
    card.write_text("1", encoding="utf-8")
    before = study.fingerprint([card])
    assert study.fingerprint([card]) == before
    card.write_text("2", encoding="utf-8")
    assert study.fingerprint([card]) != before


def test_a_study_of_recordings_that_lie_elsewhere_has_a_fingerprint(make_study, tmp_path):
    study = make_study()
    (recording, *_) = study.files()
    away = tmp_path / "away.csv"
    away.write_bytes(recording.read_bytes())
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(str(recording.relative_to(study.folder)), str(away)), encoding="utf-8")
    moved = open_study(study.folder, allow_outside=True)
    assert away in moved.files()
    assert len(moved.fingerprint()) == 64
