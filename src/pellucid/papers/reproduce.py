"""A published paper's figures beside ours: one folder with results.json, reproduction.json and a page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .._errors import PellucidError
from .reproduction import Reproduced

Progress = Callable[[str, float], None] | None

PAPERS = ("able", "knee", "hill")


@dataclass(frozen=True)
class Reproduction:
    """What was written.

    Parameters
    ----------
    page : Path
    lines : tuple of str
        The main figures, a sentence each.
    """

    page: Path
    lines: tuple[str, ...]


def reproduce(paper: str, out: str | Path, *, on_progress: Callable[[str, float], None] | None = None) -> Reproduction:
    """Reproduce a paper.

    Parameters
    ----------
    paper : str
        One of `PAPERS`.
    out : path-like
        Folder, made if it is not there.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Reproduction

    Raises
    ------
    PellucidError
        If the paper is not known.
    """
    if paper not in PAPERS:
        raise PellucidError(f"unknown paper {paper!r}; known: {', '.join(PAPERS)}")
    made, page, shown = {"able": _able, "knee": _knee, "hill": _hill}[paper](Path(out), on_progress)
    lines = []
    for row in made:
        if not row.id.startswith(shown) or row.id.count(".") > 3:
            continue
        ours = "none" if row.ours is None else f"{row.ours:.4g}"
        between = "" if row.lower is None else f" ({row.lower:.4g} to {row.upper:.4g})"
        beside = "" if row.published is None else f", published {row.published:.4g}"
        unit = "" if row.unit == "1" else f" {row.unit.replace('*', '·')}"
        lines.append(f"{row.quantity}: {ours}{between}{unit}{beside}")
    return Reproduction(page, tuple(lines))


def _able(out: Path, on_progress: Progress) -> tuple[tuple[Reproduced, ...], Path, tuple[str, ...]]:
    from .able.page import write_able_page
    from .able.reproduce_able import reproduce_able

    made = reproduce_able(out, on_progress=on_progress)
    main = "table1.", "consistent.ratio", "load.ratio", "load.torque_error", "friction_needed.factor"
    laws = *(f"transparency.duration.{law}" for law in ("fc", "pcfr", "clpc")), "transparency.torque.best_over_fc"
    shown = *(f"able.{name}" for name in main), *laws, "safety.unsafe", "study.seconds"
    return made.rows, write_able_page(out, made), shown


def _knee(out: Path, on_progress: Progress) -> tuple[tuple[Reproduced, ...], Path, tuple[str, ...]]:
    from .knee.page import write_knee_page
    from .knee.reproduce_knee import reproduce_knee

    made = reproduce_knee(out, on_progress=on_progress)
    main = "mgl_e.error", "mgl_sh.error", "orthosis.inertia.error", "tf.fit", "emg.rmse.", "coupled.fit", "residual."
    shown = [r for r in made.rows if not r.id.endswith(tuple(made.wearers)) and "_axes" not in r.id]
    return tuple(shown), write_knee_page(out, made), tuple(f"knee.{name}" for name in main)


def _hill(out: Path, on_progress: Progress) -> tuple[tuple[Reproduced, ...], Path, tuple[str, ...]]:
    from .hill.page import write_hill_page
    from .hill.reproduce_hill import reproduce_hill

    made = reproduce_hill(out, on_progress=on_progress)
    main = "rmse.truth.", "rmse.eq12.mean", "p.error.rich", "q.error.rich", "adam."
    shown = [r for r in made.rows if r.id.rsplit(".", 1)[-1] not in (*made.subjects, "truncated", "recorded")]
    return tuple(shown), write_hill_page(out, made), tuple(f"hill.{name}" for name in main)
