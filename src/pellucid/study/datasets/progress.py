"""A download's progress on the terminal."""

from __future__ import annotations


class Bar:
    """Progress bar with the few methods Pooch calls."""

    def __init__(self, title: str):
        from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn

        self._progress = Progress(TextColumn("{task.description}"), BarColumn(), DownloadColumn(), transient=True)
        self._task = self._progress.add_task(title, total=None)
        self._total: float | None = None

    def __enter__(self) -> Bar:
        self._progress.start()
        return self

    def __exit__(self, *_) -> None:
        self._progress.stop()

    @property
    def total(self) -> float | None:
        """Size of the file [byte]."""
        return self._total

    @total.setter
    def total(self, size: float | None) -> None:
        self._total = size
        self._progress.update(self._task, total=size)

    def update(self, size: float) -> None:
        """Add `size` bytes."""
        self._progress.update(self._task, advance=size)

    def reset(self) -> None:
        """Set the progress back to 0."""
        self._progress.reset(self._task, total=self._total)

    def close(self) -> None:
        """Do nothing: Pooch calls this at the end, but the context ends the display."""
