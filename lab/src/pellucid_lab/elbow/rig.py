"""A virtual elbow exoskeleton with a sliding carriage: its recordings, its study, and robots drawn at random."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellucid.models.anthropometry import Segment
from pellucid.models.joint import GRAVITY

from ..recorded_table import MAIN_STREAM, MARKER_STREAM, Column, StoredTable, marker_columns
from ..rig import Outcome, Store, Taken, Tell
from ..shipped_rigs import shipped_rig
from .constants import ElbowConstants
from .instruments import ElbowReadings, frame, read_all
from .machine import NAMES as NAMES
from .machine import ElbowMachine
from .protocol import ElbowTrial, excitation, trials

CARRIAGE_MARKER = "C"
"""Name of the marker on the carriage."""

RAIL_MARKERS = ("R1", "R2", "R3")
"""Names of the markers on the rail."""

WEIGHING_STEP_KG = 0.005
"""Resolution of the scale on which the carriage is weighed [kg]."""


COMMENTS = {
    "": "A virtual elbow exoskeleton, recorded like a real one. Its study has the form of a"
    "\nmachine's.",
    "rig.moving_mass": "an upper limit of the mass of the forearm with its carriage",
    "rig.slider": "a carriage on the forearm; clamped at one place during each recording",
    "rig.slider.mass": "taken off and weighed",
    "rig.instruments": "what the supervisor of an exported controller may rely on",
    "rig.instruments.encoder_resolution": "one count, and four standard deviations of noise",
    "optical": "motion capture, on its own clock",
    "processing.lowpass": "both passes together: -3 dB at 4.5 Hz, as the moving mean of 100 samples had",
    "processing.dead_band": "slower, friction may be anything up to its level",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class ElbowRig(ElbowMachine):
    """The virtual elbow with its protocol and instruments, of a file like ``rigs/able-elbow.toml``."""

    kind = "slider-elbow"
    constants_type = ElbowConstants
    comments = COMMENTS

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Return the columns of the robot's file and of the cameras'."""
        columns = (
            Column("time", "time", "s", text="%.3f"),
            Column("position", "counts", "rad", self.quantum),
            Column("current", "current", "mA"),
        )
        return {MAIN_STREAM: columns, MARKER_STREAM: marker_columns((CARRIAGE_MARKER, *RAIL_MARKERS))}

    def trials(self, seed: int = 1) -> tuple[ElbowTrial, ...]:
        """Return the full protocol, with an excitation optimised for this rig; it does not depend on `seed`."""
        return trials(self, excitation)

    def record(self, trial: ElbowTrial, rng: np.random.Generator, controller: None = None) -> Taken:
        """Record a `trial` under the robot's own controller; `rng` draws noise, `controller` is unused."""
        return self._taken(*read_all(self, (trial,), rng))

    def record_all(
        self,
        trials: Sequence[ElbowTrial],
        seed: int,
        *,
        store: Store = lambda name, streams: streams,
        then: Callable[[Taken], Outcome] = lambda taken: taken,
        threads: int = 1,
        executor: Executor | None = None,
        on_progress: Tell | None = None,
    ) -> Iterator[Outcome]:
        """Record trials as `Rig.record_all` does, with all noise from one generator.

        Trials of one reference are simulated at once.
        """
        tell = on_progress or (lambda text, share: None)
        tell("moving the virtual elbow", 0.05)
        readings = read_all(self, trials, np.random.default_rng(seed), threads=threads)[::-1]
        for i in range(len(trials)):
            tell("writing recordings", 0.2 + 0.8 * i / len(trials))
            yield then(self._taken(readings.pop(), store))

    def _taken(self, read: ElbowReadings, store: Store = lambda name, streams: streams) -> Taken:
        columns = self.streams()
        own = StoredTable.of(columns[MAIN_STREAM], read.time, read.counts, read.milliamperes)
        seen = StoredTable.of(columns[MARKER_STREAM], read.optical_time, *read.markers.values())
        truth = {"slider": read.trial.slider, "clock_offset": read.clock_offset}
        files = {read.trial.name: store(read.trial.name, {MAIN_STREAM: own, MARKER_STREAM: seen})}
        return Taken(read.trial, files, truth=truth, inside=read)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """Return the contents of study.toml for the recordings that were `made`."""
        slider, span = self.constants.slider, self.constants.range
        mass = 1.5 * (self.constants.link.mass + self.constants.carriage.mass)
        weighed = round(self.constants.carriage.mass / WEIGHING_STEP_KG) * WEIGHING_STEP_KG
        rig = {
            "joint": "elbow",
            "motion": "rotary",
            "lifts": self.constants.lifts,
            "moving_mass": f"{mass:.1f} kg",
            "drive": self.drive_table,
            "slider": {
                "low": f"{slider.low} m",
                "high": f"{slider.high} m",
                "marker": CARRIAGE_MARKER,
                "mass": f"{weighed:.3f} kg",
            },
            "limits": {"position_min": f"{span.low - 0.1} rad", "position_max": f"{span.high + 0.1} rad"},
            "instruments": self.instruments_table,
        }
        processing = {"lowpass": "5 Hz", "dead_band": "0.1 rad/s", "trim": 500}
        return {**super().study(made), "rig": rig, "processing": processing, "model": {"gravity": "sine+cosine"}}

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """Return the plant's parameters, SI, with the carriage at 0; they do not depend on `seed`."""
        link, carriage = self.constants.link, self.constants.carriage
        return {
            "carriage_mass": carriage.mass,
            "gravity": GRAVITY * (link.mass * link.centre[0] + carriage.mass * carriage.centre[0]),
            "gravity_cosine": self.gravity(0.0)[1],
            "inertia": self.inertia(0.0),
            "carriage_moment": carriage.mass * carriage.centre[0],
            "axis": frame(self)[2].tolist(),
            "transmission": self.constants.transmission.model_dump(exclude_unset=True),
        }


def able_elbow() -> ElbowRig:
    """Return the rig of ``rigs/able-elbow.toml``."""
    return ElbowRig.parse(shipped_rig("able-elbow"), "able-elbow")


def drawn_rigs(rig: ElbowRig, count: int = 5, seed: int = 20261121) -> tuple[ElbowRig, ...]:
    """Return `count` further rigs, drawn with a `seed` from the ranges of ``[drawn]`` in the file of a `rig`."""
    rng = np.random.default_rng(seed)
    ranges = rig.constants.drawn
    return tuple(
        rig.changed({path: float(rng.uniform(*ends)) for path, ends in ranges.items()}, f"drawn-{i + 1}")
        for i in range(count)
    )


def with_fastened_load(robot: ElbowRig, load: Segment) -> ElbowRig:
    """Return a robot whose link also has a load that is fastened to it."""
    link = robot.constants.link
    mass = link.mass + load.mass
    along = (link.mass * link.centre[0] + load.mass * load.centre) / mass
    across = link.mass * link.centre[1] / mass
    about_axis = link.inertia + link.mass * (link.centre[0] ** 2 + link.centre[1] ** 2) + load.inertia
    inertia = about_axis - mass * (along**2 + across**2)
    values = {"link.mass": mass, "link.centre": (along, across), "link.inertia": inertia}
    return robot.changed(values, f"{robot.name}-load")
