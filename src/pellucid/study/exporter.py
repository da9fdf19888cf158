"""What `export` writes: a product as its domain offers it, and what a caller asks for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from .._domains import offered
from .._errors import PellucidError
from .study import Study


@dataclass(frozen=True)
class ExportRequest:
    """What a caller of `export` asks for; its arguments are described there."""

    study: Study
    to: str = "c"
    out: Path | None = None
    card: str | None = None
    slider: float | None = None
    participant: str | None = None
    controller: str | None = None
    exponents: tuple[float, float] | None = None
    load: tuple[float, float] | None = None
    held: tuple[float, float] | None = None
    period: float | None = None
    probe: bool = False
    allow_outside: bool = False
    overwrite: bool = False


class Exporter(ABC):
    """A product that can be exported: which requests are for it, which options it has, and how it is written."""

    kinds: ClassVar[tuple[str, ...]]
    """Values of `to` that name the product."""

    order: ClassVar[int]
    """Exporters are asked in this order; the first one that fits writes."""

    unused: ClassVar[tuple[str, ...]] = ()
    """Options that the product does not have."""

    why_unused: ClassVar[str] = ""
    """The reason, as an error message ends with it."""

    def fits(self, request: ExportRequest) -> bool:
        """Return whether a request with one of the `kinds` is for this product."""
        return True

    def place(self, request: ExportRequest) -> str:
        """Return how an error message names a request."""
        return f"export to {request.to} of {request.study.name}"

    def require_options(self, request: ExportRequest) -> None:
        """Raise a PellucidError if the request has an option that the product does not have."""
        for name in self.unused:
            if getattr(request, name) not in (None, False):
                raise PellucidError(f"{self.place(request)}: found {name}, expected none: {self.why_unused}")

    @abstractmethod
    def export(self, request: ExportRequest) -> Path:
        """Write the product and return its folder or file."""


def find_exporter(request: ExportRequest, kind: type[Exporter] = Exporter) -> Exporter:
    """Return the exporter that a request is for, with its options checked.

    Raises
    ------
    PellucidError
        If no exporter knows `to`, or the request has an option that the product does not have.
    """
    fitting = (each() for each in offered("EXPORTER_CLASSES") if issubclass(each, kind))
    known = sorted(fitting, key=lambda each: each.order)
    exporter = next((each for each in known if request.to in each.kinds and each.fits(request)), None)
    if exporter is None:
        names = " or ".join(f'"{name}"' for name in dict.fromkeys(name for each in known for name in each.kinds))
        raise PellucidError(f'export: found to = "{request.to}", expected {names}')
    exporter.require_options(request)
    return exporter
