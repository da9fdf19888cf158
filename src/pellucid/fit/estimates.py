"""What every fit returns: estimates by name, with their covariance, printed as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape

import numpy as np

from ..models.card import named
from .parameter import Parameter


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Estimates(Mapping[str, Parameter]):
    """Estimated parameters by name: ``fit["inertia"].value``, ``fit["inertia"].interval(0.95)``.

    Attributes
    ----------
    parameters : tuple of Parameter
        In the order of the covariance.
    covariance : ndarray, shape (p, p)
        SI.
    title : str
        What was estimated, in a few words.
    confidence : float
        Of the intervals that are printed.
    """

    parameters: tuple[Parameter, ...]
    covariance: np.ndarray = field(repr=False)
    title: str = ""
    confidence: float = 0.95

    @property
    def every(self) -> tuple[Parameter, ...]:
        """The parameters, then what follows from them."""
        return self.parameters

    @property
    def array(self) -> np.ndarray:
        """Values of the parameters in their order, shape (p,), SI."""
        return np.array([p.value for p in self.parameters])

    def interval(self, name: str, level: float | None = None) -> tuple[float, float]:
        """Confidence interval of the parameter `name` at `level`, by default at `confidence`; in its unit."""
        return self[name].interval(self.confidence if level is None else level)

    def __getitem__(self, name: str) -> Parameter:
        return named(self.every, name, self.title or "this fit")

    def __iter__(self) -> Iterator[str]:
        return (p.name for p in self.every)

    def __len__(self) -> int:
        return len(self.every)

    def _rows(self) -> list[tuple[str, ...]]:
        return [(p.name, *_shown(p, self.confidence), p.unit, _remark(p)) for p in self.every]

    def _head(self) -> tuple[str, ...]:
        return "", "value", f"{100.0 * self.confidence:g} % interval", "unit", ""

    def _facts(self) -> tuple[str, ...]:
        """Sentences below the table: how good the fit is."""
        return ()

    def __str__(self) -> str:
        table = [self._head(), *self._rows()]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in table]
        return "\n".join(filter(None, (self.title, *lines, *self._facts())))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        def row(cells: tuple[str, ...], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        rows = row(self._head(), "th") + "".join(row(cells, "td") for cells in self._rows())
        facts = "".join(f"<p>{escape(fact)}</p>" for fact in self._facts())
        return f"<table><caption>{escape(self.title)}</caption>{rows}</table>{facts}"


def _shown(parameter: Parameter, level: float) -> tuple[str, str]:
    """Value and interval with as many digits as two of the standard error."""
    value, error = parameter.value, parameter.standard_error
    low, high = parameter.interval(level)
    if not (np.isfinite(error) and error > 0.0) or parameter.refused:
        return f"{value:.4g}", "refused" if parameter.refused else "-"
    places = int(1 - np.floor(np.log10(error)))
    if not 0 <= places <= 8 or abs(value) >= 1e7:
        return f"{value:.4g}", f"{low:.4g} to {high:.4g}"
    return f"{value:.{places}f}", f"{low:.{places}f} to {high:.{places}f}"


def _remark(parameter: Parameter) -> str:
    if parameter.at_bound:
        return "held by its bound"
    if parameter.refused:
        return f"refused: {parameter.refused}"
    return "" if parameter.identifiable else "not told from 0"
