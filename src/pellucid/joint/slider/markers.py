"""From markers that a motion capture saw to where a joint's axis is and where a carriage on its moving segment sits.

A point fixed to the segment goes p = p0 + a cos q + b sin q: linear in p0, a and b once the clocks agree. In the plane
of rotation, with x0 the direction of gravity in it and q = 0 where the segment hangs, the carriage's marker is at
X = x cos q - d sin q, Y = x sin q + d cos q from the axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from ..._errors import RecordingError
from ...files.fault import Fault
from ...files.optical import OpticalRecording
from ...files.optical_faults import MARKER_LIMITS
from ...files.recording import Recording


@dataclass(frozen=True)
class MarkerLimits:
    """Limits of what markers and clocks may show, and of the searches in them."""

    max_searched_delay_s: float = 0.25  # Delays between the clocks are searched up to this time in either direction
    # Delays are first tried this far apart [s]: a tenth of the fastest joint's quarter period.
    coarse_step: float = 0.025
    coarse_frames: int = 1500  # Number of evenly picked frames in the first search
    # Number of evenly picked frames in the final search. More would improve the delay by microseconds only.
    fine_frames: int = 6000
    min_turn_rad: float = 0.1  # A joint must turn by at least this to show its axis and the delay between two clocks
    # Two clocks are aligned only if the standard error of their delay is below this: half a frame.
    max_delay_error_s: float = 0.003
    # A drift with a larger standard error is set to 0; quartz clocks differ by a few times this value.
    max_drift_error: float = 10e-6
    # A marker with a larger RMS residual did not turn with the segment: ten times a motion capture's noise.
    max_marker_residual_m: float = 0.003
    # A marker on a smaller circle is fixed to the room and carries no information on the axis.
    min_circle_radius_m: float = 0.005
    # A marker further than this from its place in the other recordings was moved, or has another marker's name.
    min_moved_distance_m: float = 0.005
    min_reported_delay_s: float = 0.003  # Delays above this are reported: half a frame
    # Smallest share of gravity in the plane of rotation (10 degrees); below it the hanging direction is undefined.
    min_gravity_share: float = 0.17


LIMITS = MarkerLimits()


@dataclass(frozen=True)
class ClockOffset:
    """How far a motion capture's clock is from a robot's."""

    # What happens at robot time t stands at optical time t + delay, at the motion capture's first frame [s]
    delay: float
    delay_se: float  # Its standard error [s]; infinite where nothing tells
    drift: float  # Seconds by which the delay grows per second; 0 where it could not be told
    identifiable: bool  # Whether the motion tells the delay; it is 0 otherwise
    reason: str = ""  # Why it does not; empty where it does

    def robot_time(self, optical_time: np.ndarray) -> np.ndarray:
        """Times of frames on the robot's clock, shape (n,) [s]."""
        return optical_time - self.delay - self.drift * (optical_time - optical_time[0])


@dataclass(frozen=True, eq=False)
class Axis:
    """A joint's axis of rotation in the lab."""

    direction: np.ndarray  # (3,) Of length 1; a growing angle turns about it by the right hand
    origin: np.ndarray  # (3,) Point on it nearest to the mean of the markers [m]
    direction_se: float  # standard error of the direction, as a tilt [rad]
    origin_se: float  # standard error of the origin in either direction across the axis [m]
    residual: float  # RMS residual of all markers that were used, each coordinate [m]


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the carriage was in one recording."""

    recording: str  # Its name
    # slider, height: x and d of the carriage's marker: along the segment and across it, from the axis [m]. By a ruler,
    # `height` is the other recordings' median, NaN where there is none
    slider: float
    height: float
    # slider_se, height_se: Standard errors [m], of noise: what a transmission gives way between encoder and segment is
    # not among it. NaN where a ruler told
    slider_se: float
    height_se: float
    # delay, delay_se, drift: As in `ClockOffset`; where the motion did not tell, the median delay of the recordings
    # that did, or 0
    delay: float = 0.0
    delay_se: float = np.inf
    drift: float = 0.0
    aligned: bool = False  # Whether the recording's own motion told the delay
    frames: int = 0  # frames, lost: Frames in which the carriage's marker was used, and those in which it was lost
    lost: int = 0
    longest_loss: float = 0.0  # [s]
    # Marker to its residual against rotation about the common axis, each coordinate [m rms]
    residuals: Mapping[str, float] = field(default_factory=dict)
    # Markers that sit elsewhere than in the other recordings, and how far [m]; the carriage's is among them where it
    # sits on another marker's place
    moved: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""  # Why it is not aligned
    file: str = ""  # The motion capture's, or the recording's where a ruler told
    ruler: float | None = None  # What a ruler said [m]

    @property
    def optical(self) -> bool:
        """Whether a motion capture told the place."""
        return self.frames > 0


@dataclass(frozen=True, eq=False)
class Geometry:
    """A rig's axis and its carriage's places, as markers show them."""

    # origin, axis: (3,) Point on the axis beside the carriage's marker [m], and the axis's direction; NaN where all
    # places are known by a ruler
    origin: np.ndarray
    axis: np.ndarray
    origin_se: float  # origin_se, axis_se: Standard errors across the axis [m], and of its tilt [rad]
    axis_se: float
    residual: float  # RMS residual of all used markers against rotation about the axis, each coordinate [m]
    placements: tuple[Placement, ...]  # One for each recording, in their order
    carriage: str  # The marker on the carriage

    def __getitem__(self, recording: str) -> Placement:
        for placement in self.placements:
            if placement.recording == recording:
                return placement
        known = ", ".join(placement.recording for placement in self.placements)
        raise RecordingError(
            f'found no position of the carriage for recording "{recording}", expected one of {known or "none"}'
        )


def clock_offset(
    time: np.ndarray,
    angle: np.ndarray,
    optical_time: np.ndarray,
    markers: Mapping[str, np.ndarray],
    direction: np.ndarray | None = None,
) -> ClockOffset:
    """How far a motion capture's clock is from a robot's, from the motion both saw.

    Every marker is fitted by p0 + a cos q + b sin q with the angle taken at the delayed time; the delay, and a drift
    where the recording is long enough to tell it, make what is left least.

    `time`, `angle` (m,) [s], [rad]; `optical_time` (n,) [s]; `markers` (n, 3) [m]; `direction` (3,).
    """
    known = np.isfinite(time) & np.isfinite(angle)
    time, angle = time[known], angle[known]
    if len(time) < 2 or np.ptp(angle) < LIMITS.min_turn_rad:
        turned = np.ptp(angle) if len(angle) else 0.0
        return _unknown(f"the joint turns by {turned:.3g} rad, expected at least {LIMITS.min_turn_rad:g} rad")
    own = optical_time - optical_time[0]
    inside = np.flatnonzero(
        (optical_time >= time[0] + LIMITS.max_searched_delay_s)
        & (optical_time <= time[-1] - LIMITS.max_searched_delay_s)
    )
    if len(inside) < MARKER_LIMITS.min_frames // 4:
        return _unknown(f"only {len(inside)} frames stand well within the robot's time")
    picked = inside[:: max(1, len(inside) // LIMITS.coarse_frames)]
    delay = _coarse_delay(time, angle, optical_time[picked], {m: p[picked] for m, p in markers.items()}, direction)
    if delay is None:
        return _unknown("no marker that turns with the joint was seen often enough")
    picked = inside[:: max(1, len(inside) // LIMITS.fine_frames)]
    found = _fine_delay(
        time, angle, optical_time[picked], own[picked], {m: p[picked] for m, p in markers.items()}, delay
    )
    if not abs(found.delay) <= LIMITS.max_searched_delay_s:
        return _unknown(f"no delay within {LIMITS.max_searched_delay_s:g} s makes the markers follow the joint")
    if not found.delay_se <= LIMITS.max_delay_error_s:
        return _unknown(
            f"the delay is only known to {1e3 * found.delay_se:.2g} ms, expected {1e3 * LIMITS.max_delay_error_s:g} ms"
        )
    return found


def slider_geometry(recordings: Sequence[Recording], marker: str | None = None) -> Geometry:
    """Locate the axis, and the carriage in each recording; clocks are aligned on the way.

    What all recordings share (the axis, the usual delay, the usual heights) comes from those with ``use = "fit"``.
    """
    seen = [r for r in recordings if r.optical is not None]
    for recording in recordings:
        if recording.optical is None and recording.slider is None:
            raise RecordingError(
                f"{recording.path.name} (recording {recording.name}): found no place of the carriage, expected an "
                "optical file or slider in [[recordings]]"
            )
    carriages = [_carriage(r, marker) for r in seen]
    if not seen:
        nowhere = np.full(3, np.nan)
        placed = tuple(_by_ruler(r, np.nan) for r in recordings)
        return Geometry(nowhere, nowhere, np.nan, np.nan, np.nan, placed, marker or "")
    clocks = _clocks(seen)
    fitted = [i for i, r in enumerate(seen) if r.use == "fit"] or list(range(len(seen)))
    usual = float(np.median([clocks[i].delay for i in fitted if clocks[i].identifiable] or [0.0]))
    identifiable = [i for i in fitted if clocks[i].identifiable]
    clocks = [c if c.identifiable else replace(c, delay=usual) for c in clocks]
    tracks = [_track(r, c, clock) for r, c, clock in zip(seen, carriages, clocks, strict=True)]
    axis = _axis([tracks[i] for i in identifiable])
    x0, y0 = _hanging(axis.direction, _optical_of(seen[fitted[0]]))
    basis = np.array([x0, y0, axis.direction])
    places = [_places(track, basis, axis) for track in tracks]
    along = float(np.mean([places[i][carriages[i]].at[2] for i in fitted]))
    usually = _usual_places([places[i] for i in fitted], set(carriages))
    found = {}
    for recording, carriage, clock, place in zip(seen, carriages, clocks, places, strict=True):
        optical, at = _optical_of(recording), place[carriage]
        lost, longest = _losses(optical, carriage)
        found[recording.name] = Placement(
            recording=recording.name,
            slider=float(at.at[0]),
            height=float(at.at[1]),
            slider_se=at.se,
            height_se=at.se,
            delay=clock.delay,
            delay_se=clock.delay_se,
            drift=clock.drift,
            aligned=clock.identifiable,
            frames=at.frames,
            lost=lost,
            longest_loss=longest,
            residuals=MappingProxyType({m: p.residual for m, p in place.items()}),
            moved=MappingProxyType(_moved(place, usually, carriage)),
            reason=clock.reason,
            file=optical.path.name,
            ruler=recording.slider,
        )
    height = float(np.median([found[seen[i].name].height for i in fitted]))
    return Geometry(
        origin=axis.origin + (along - axis.origin @ axis.direction) * axis.direction,
        axis=axis.direction,
        origin_se=axis.origin_se,
        axis_se=axis.direction_se,
        residual=axis.residual,
        placements=tuple(found[r.name] if r.name in found else _by_ruler(r, height) for r in recordings),
        carriage=carriages[0],
    )


def geometry_faults(geometry: Geometry, rail: tuple[float, float] | None = None) -> list[Fault]:
    """What is wrong or remarkable in what the markers show; `rail` are its ends, from the joint's axis [m]."""
    faults: list[Fault] = []
    for placement in geometry.placements:

        def add(severity: str, kind: str, channel: str, found: str, expected: str, p: Placement = placement) -> None:
            what = "time" if channel == "time" else f"marker {channel}"
            message = f"{p.file} (recording {p.recording}), {what}: found {found}, expected {expected}"
            faults.append(Fault(severity, kind, p.file, channel, found, expected, message))

        _clock_fault(placement, add)
        _marker_faults(placement, geometry.carriage, add)
        if rail is not None:
            slack = LIMITS.min_moved_distance_m + 3.0 * (placement.slider_se if placement.optical else 0.0)
            if not rail[0] - slack <= placement.slider <= rail[1] + slack:
                found = f"the carriage at {1e3 * placement.slider:.1f} mm"
                expected = f"{1e3 * rail[0]:.0f} mm to {1e3 * rail[1]:.0f} mm as [rig.slider] says"
                add("refuse", "place", geometry.carriage, found, expected)
    return sorted(faults, key=lambda fault: fault.severity != "refuse")


def _clock_fault(placement: Placement, add) -> None:
    if not placement.optical:
        return
    if not placement.aligned:
        taken = f"a delay of {1e3 * placement.delay:.1f} ms is taken"
        add("note", "clock", "time", f"no delay: {placement.reason}", f"a motion that aligns the clocks; {taken}")
    elif abs(placement.delay) > LIMITS.min_reported_delay_s:
        way = "later" if placement.delay > 0 else "earlier"
        drift = f", {1e6 * placement.drift:+.0f} ppm" if placement.drift else ""
        found = (
            f"events {1e3 * abs(placement.delay):.1f} ms {way} on the optical clock than on the robot's "
            f"(standard error {1e3 * placement.delay_se:.2g} ms{drift}), corrected"
        )
        add("note", "clock", "time", found, "clocks that agree")


def _marker_faults(placement: Placement, carriage: str, add) -> None:
    for marker, residual in placement.residuals.items():
        if residual > LIMITS.max_marker_residual_m:
            found = f"it {1e3 * residual:.1f} mm rms off a rotation about the axis"
            severity = "refuse" if marker == carriage else "note"
            expected = (
                f"at most {1e3 * LIMITS.max_marker_residual_m:g} mm: markers that swapped names, or one that came loose"
            )
            add(severity, "marker", marker, found, expected)
    for marker, distance in placement.moved.items():
        if marker == carriage:
            add("refuse", "marker", marker, "it where another marker sits in the other recordings", "its own place")
        else:
            found = f"it {1e3 * distance:.1f} mm from where it sits in the other recordings"
            add(
                "note",
                "marker",
                marker,
                found,
                f"at most {1e3 * LIMITS.min_moved_distance_m:g} mm: it was moved, or bears another's name",
            )
    if (
        placement.optical
        and placement.ruler is not None
        and abs(placement.slider - placement.ruler) > LIMITS.min_moved_distance_m
    ):
        found = f"the carriage at {1e3 * placement.slider:.1f} mm"
        add("note", "place", carriage, found, f"{1e3 * placement.ruler:.1f} mm as the ruler says")


def _unknown(reason: str) -> ClockOffset:
    return ClockOffset(0.0, np.inf, 0.0, False, reason)


def _coarse_delay(time, angle, optical_time, markers, direction) -> float | None:
    """The delay among a few that leaves least, all tried at once."""
    half = round(LIMITS.max_searched_delay_s / LIMITS.coarse_step)
    delays = LIMITS.coarse_step * np.arange(-half, half + 1)
    q = np.interp(optical_time - delays[:, None], time, angle)
    basis = np.stack([np.ones_like(q), np.cos(q), np.sin(q)], axis=2)
    left, turns = np.zeros(len(delays)), np.zeros((len(delays), 3))
    used = False
    for points in markers.values():
        seen = np.isfinite(points[:, 0])
        if seen.sum() < 50:
            continue
        z = basis[:, seen]
        p = points[seen] - points[seen].mean(axis=0)
        normal = z.transpose(0, 2, 1) @ z
        # A delay at which the joint hardly moves leaves the three columns alike.
        normal += 1e-12 * seen.sum() * np.eye(3)
        moments = z.transpose(0, 2, 1) @ p
        found = np.linalg.solve(normal, moments)
        left += np.sum(p * p) - np.sum(moments * found, axis=(1, 2))
        turns += np.cross(found[:, 1], found[:, 2])
        used = True
    if not used:
        return None
    if direction is not None and (turns @ direction > 0.0).any():
        left = np.where(turns @ direction > 0.0, left, np.inf)
    return float(delays[np.argmin(left)])


def _fine_delay(time, angle, optical_time, own, markers, delay) -> ClockOffset:
    """Find delay and drift by Gauss-Newton; linear unknowns are solved for at every step."""
    seen = {m: np.isfinite(p[:, 0]) for m, p in markers.items()}
    centred = {m: p[seen[m]] - p[seen[m]].mean(axis=0) for m, p in markers.items() if seen[m].sum() >= 50}
    drift, variance, drifting = 0.0, np.inf, False
    for step in range(10):
        at = optical_time - delay - drift * own
        q, speed = np.interp(at, time, angle), _speed(at, time, angle)
        cos, sin = np.cos(q), np.sin(q)
        columns = np.column_stack(
            [np.ones_like(q), cos, sin, speed * sin, speed * cos, own * speed * sin, own * speed * cos]
        )
        curvature, slope = np.zeros((2, 2)), np.zeros(2)
        residuals = []
        for marker, p in centred.items():
            g = columns if seen[marker].all() else columns[seen[marker]]
            gram = g.T @ g
            found = np.linalg.solve(gram[:3, :3] + 1e-12 * len(g) * np.eye(3), g[:, :3].T @ p)
            rest = p - g[:, :3] @ found
            # d p / d delay = -dq/dt (b cos q - a sin q), and so much times the clock for the drift.
            ways = np.zeros((2, 7, 3))
            ways[0, 3], ways[0, 4] = found[1], -found[2]
            ways[1, 5], ways[1, 6] = found[1], -found[2]
            free = gram - gram[:, :3] @ np.linalg.solve(gram[:3, :3] + 1e-12 * len(g) * np.eye(3), gram[:3])
            curvature += np.einsum("iac,ab,jbc->ij", ways, free, ways)
            slope += np.einsum("iac,ac->i", ways, g.T @ rest)
            residuals.append(rest)
        if curvature[0, 0] <= 0.0:
            return _unknown("no marker turns with the joint")
        freedom = max(1, sum(r.size for r in residuals) - 9 * len(residuals))
        variance = _colour(residuals) * sum(_squares(r) for r in residuals) / freedom
        if not drifting:
            move = np.array([slope[0] / curvature[0, 0], 0.0])
            # A drift is looked for where it can be told, once the delay is found.
            if abs(move[0]) < 1e-4 or step == 4:
                drifting = _drift_error(curvature, variance) < LIMITS.max_drift_error
                if drifting:
                    move = np.linalg.solve(curvature, slope)
        else:
            move = np.linalg.solve(curvature, slope)
        delay, drift = delay + float(move[0]), drift + float(move[1])
        if not abs(delay) < 2 * LIMITS.max_searched_delay_s:
            break
        if abs(move[0]) < 1e-7 and abs(move[1]) < 1e-8:
            break
    error = variance * (np.linalg.inv(curvature)[0, 0] if drifting else 1.0 / curvature[0, 0])
    return ClockOffset(delay, float(np.sqrt(error)), drift, True)


def _drift_error(curvature: np.ndarray, variance: float) -> float:
    determinant = np.linalg.det(curvature)
    return np.inf if determinant <= 0.0 else float(np.sqrt(variance * curvature[0, 0] / determinant))


def _speed(at: np.ndarray, time: np.ndarray, angle: np.ndarray, half: float = 0.01) -> np.ndarray:
    """Joint speed at some times, over 20 ms so that an encoder's steps do not matter, shape (n,) [rad/s]."""
    return (np.interp(at + half, time, angle) - np.interp(at - half, time, angle)) / (2.0 * half)


def _squares(residuals: np.ndarray) -> float:
    return float(np.einsum("ij,ij->", residuals, residuals))


def _colour(residuals: Sequence[np.ndarray]) -> float:
    """By how much residuals that resemble their neighbours widen a variance, at least 1."""
    squares = sum(_squares(r) for r in residuals)
    if squares == 0.0:
        return 1.0
    alike = sum(float(np.einsum("ij,ij->", r[1:], r[:-1])) for r in residuals) / squares
    alike = min(max(alike, 0.0), 0.99)
    return (1.0 + alike) / (1.0 - alike)


@dataclass(frozen=True)
class _Circle:
    """One marker of one recording: sums over its frames, and its own free fit."""

    marker: str
    count: int
    cos: float  # sums over the frames
    sin: float
    normal: np.ndarray  # (3, 3): of 1, cos q, sin q
    moments: np.ndarray  # (3, 3): the same with the coordinates
    swing: np.ndarray  # (2, 3): a and b [m]
    variance: float  # residual variance of the free fit, each coordinate [m^2]


class _Track:
    """A recording's frames with the joint's angle at each, and its markers' circles about nothing yet."""

    def __init__(self, angle: np.ndarray, markers: Mapping[str, np.ndarray]):
        self.angle, self.markers = np.asarray(angle, float), markers
        within = np.isfinite(self.angle)
        self.basis = np.column_stack([np.ones(len(within)), np.cos(self.angle), np.sin(self.angle)])
        turned = float(np.ptp(self.angle[within])) if within.any() else 0.0
        self.moves = turned >= LIMITS.min_turn_rad
        self.frames = {m: _one_stretch(within & np.isfinite(p[:, 0])) for m, p in markers.items()}
        self.circles = [c for m in markers if (c := self._circle(m)) is not None]

    def _circle(self, marker: str) -> _Circle | None:
        frames = self.frames[marker]
        z, p = self.basis[frames], self.markers[marker][frames]
        count = len(p)
        if count < 10:
            return None
        middle = z[:, 0] @ p / count
        p = p - middle
        normal, moments = z.T @ z, z.T @ p
        found = np.zeros((3, 3))
        if self.moves:
            found = np.linalg.solve(normal + 1e-12 * count * np.eye(3), moments)
        rest = p - z @ found if self.moves else p
        variance = max(_squares(rest) / (3.0 * count), 1e-12)
        # Sums with the coordinates themselves, the middle put back.
        whole = moments + np.outer(z.sum(axis=0), middle)
        return _Circle(marker, count, normal[0, 1], normal[0, 2], normal, whole, found[1:], variance)


def _one_stretch(frames: np.ndarray) -> np.ndarray | slice:
    """The frames of a mask; as a slice, which copies nothing, where they follow one another."""
    at = np.flatnonzero(frames)
    return slice(at[0], at[-1] + 1) if len(at) and at[-1] - at[0] + 1 == len(at) else frames


def _axis(tracks: Sequence[_Track]) -> Axis:
    circles = [
        c
        for t in tracks
        if t.moves
        for c in t.circles
        if np.hypot(*np.linalg.norm(c.swing, axis=1)) > LIMITS.min_circle_radius_m
    ]
    sound = [c for c in circles if c.variance < LIMITS.max_marker_residual_m**2] or circles
    if not sound:
        raise RecordingError(
            f"found no recording in which the joint turns by {LIMITS.min_turn_rad:g} rad and a marker with it, with "
            "both clocks aligned; expected one at least, to show the joint's axis"
        )
    swings, sense = np.zeros((3, 3)), np.zeros(3)
    for c in sound:
        weight = np.linalg.inv(np.linalg.inv(c.normal + 1e-12 * c.count * np.eye(3))[1:, 1:]) / c.variance
        swings += c.swing.T @ weight @ c.swing
        sense += np.cross(c.swing[0], c.swing[1]) * np.sqrt(max(np.linalg.det(weight), 0.0))
    values, vectors = np.linalg.eigh(swings)
    direction = vectors[:, 0] * (1.0 if vectors[:, 0] @ sense >= 0.0 else -1.0)
    e1, e2 = vectors[:, 2], np.cross(direction, vectors[:, 2])
    basis = np.array([e1, e2, direction])
    information, wanted = 0.0, np.zeros(2)
    for c in sound:
        info, right = _centre(c, basis)
        information += info / c.variance
        wanted += right / c.variance
    middle = np.sum([c.moments[0] for c in sound], axis=0) / sum(c.count for c in sound)
    origin = np.array([*(wanted / information), direction @ middle]) @ basis
    rests = _rests(tracks, {(id(c)) for c in sound}, basis, origin)
    squares, total = sum(_squares(r) for r in rests), sum(r.size for r in rests)
    residual = float(np.sqrt(squares / total))
    # Weights are of the free fits; what rotation about one axis leaves beyond them widens the errors too.
    free = np.sqrt(sum(c.count * c.variance for c in sound) / sum(c.count for c in sound))
    wider = _colour(rests) * max(1.0, (residual / free) ** 2)
    return Axis(
        direction,
        origin,
        float(np.sqrt(wider / max(values[1], 1e-300))),
        float(np.sqrt(wider / max(information, 1e-300))),
        residual,
    )


def _centre(c: _Circle, basis: np.ndarray) -> tuple[float, np.ndarray]:
    """Information on the axis's place in the plane of rotation, and that times the place, for unit noise."""
    turn = np.array([[c.cos, -c.sin], [c.sin, c.cos]])
    return c.count - (c.cos**2 + c.sin**2) / c.count, (c.moments[0] @ basis.T)[:2] - turn @ _back(c, basis) / c.count


def _back(c: _Circle, basis: np.ndarray) -> np.ndarray:
    """Sum over the frames of the place in the plane of rotation, turned back by the joint's angle, shape (2,)."""
    cos, sin = c.moments[1] @ basis.T, c.moments[2] @ basis.T
    return np.array([cos[0] + sin[1], cos[1] - sin[0]])


def _on_link(c: _Circle, basis: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Where a marker sits on the segment: along the basis's first and second at q = 0, and along the axis, (3,)."""
    centre = basis[:2] @ origin
    turn = np.array([[c.cos, c.sin], [-c.sin, c.cos]])
    x, d = (_back(c, basis) - turn @ centre) / c.count
    return np.array([x, d, basis[2] @ c.moments[0] / c.count])


def _rest(track: _Track, c: _Circle, basis: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """What rotation about the axis leaves of a marker, shape (frames, 3), along the lab's axes [m]."""
    frames = track.frames[c.marker]
    x, d, along = _on_link(c, basis, origin)
    circle = np.array([[*(basis[:2] @ origin), along], [x, d, 0.0], [-d, x, 0.0]]) @ basis
    return track.markers[c.marker][frames] - track.basis[frames] @ circle


def _rests(tracks, wanted: set[int], basis, origin) -> list[np.ndarray]:
    return [_rest(t, c, basis, origin) for t in tracks for c in t.circles if id(c) in wanted]


@dataclass(frozen=True)
class _Place:
    at: np.ndarray  # (3,) x, d, and the coordinate along the axis [m]
    se: float  # standard error of x, and of d [m]
    residual: float
    frames: int


def _places(track: _Track, basis: np.ndarray, axis: Axis) -> dict[str, _Place]:
    found = {}
    for c in track.circles:
        rest = _rest(track, c, basis, axis.origin)
        variance = _squares(rest) / rest.size
        own = _colour([rest]) * variance / c.count
        shared = (c.cos**2 + c.sin**2) / c.count**2 * axis.origin_se**2
        found[c.marker] = _Place(
            _on_link(c, basis, axis.origin), float(np.sqrt(own + shared)), float(np.sqrt(variance)), c.count
        )
    return found


def _hanging(direction: np.ndarray, optical: OpticalRecording) -> tuple[np.ndarray, np.ndarray]:
    """Where a hanging segment points, and where it goes when it is lifted, each shape (3,)."""
    x0 = optical.down - (optical.down @ direction) * direction
    share = float(np.linalg.norm(x0))
    if share < LIMITS.min_gravity_share:
        raise RecordingError(
            f"{optical.path.name}: found an axis within {np.degrees(np.arcsin(share)):.2g} degrees of [optical] down, "
            "expected a more horizontal one: gravity defines no zero of the angle"
        )
    return x0 / share, np.cross(direction, x0 / share)


def _optical_of(recording: Recording) -> OpticalRecording:
    """Return the motion capture of a recording that has one."""
    assert recording.optical is not None  # recordings without one are placed by a ruler before
    return recording.optical


def _carriage(recording: Recording, marker: str | None) -> str:
    optical = _optical_of(recording)
    wanted = marker if marker is not None else optical.carriage
    if wanted is None or wanted not in optical.markers:
        raise RecordingError(
            f"{optical.path.name} (recording {recording.name}): found the markers {', '.join(optical.markers)}, "
            f"expected {wanted or 'one that [rig.slider] marker names'}, the carriage's, among them"
        )
    return wanted


def _clocks(recordings: Sequence[Recording]) -> list[ClockOffset]:
    """Each recording's, first by itself, then again where it would turn the other way than most."""

    def clock(r: Recording, direction: np.ndarray | None = None) -> ClockOffset:
        optical = _optical_of(r)
        return clock_offset(r.time[r.sound], r["position"][r.sound], optical.time, optical.markers, direction)

    clocks = [clock(r) for r in recordings]
    ways = [_way(r, c) if c.identifiable else np.zeros(3) for r, c in zip(recordings, clocks, strict=True)]
    most = np.sum(ways, axis=0) if ways else np.zeros(3)
    return [clock(r, most) if way @ most < 0.0 else c for r, c, way in zip(recordings, clocks, ways, strict=True)]


def _way(recording: Recording, clock: ClockOffset) -> np.ndarray:
    """About what direction the markers turn, of length 1, shape (3,)."""
    optical = _optical_of(recording)
    few = slice(None, None, max(1, len(optical) // LIMITS.coarse_frames))
    sound = recording.sound
    angle = np.interp(clock.robot_time(optical.time)[few], recording.time[sound], recording["position"][sound])
    turned = sum(
        (np.cross(*c.swing) for c in _Track(angle, {m: p[few] for m, p in optical.markers.items()}).circles),
        np.zeros(3),
    )
    length = np.linalg.norm(turned)
    return turned / length if length else turned


def _track(recording: Recording, carriage: str, clock: ClockOffset) -> _Track:
    optical = _optical_of(recording)
    at = clock.robot_time(optical.time)
    known = np.isfinite(recording.time) & np.isfinite(recording["position"]) & recording.sound
    # Frames before and after the robot's recording have no angle.
    angle = np.interp(at, recording.time[known], recording["position"][known], left=np.nan, right=np.nan)
    used = int(np.sum(np.isfinite(angle) & optical.seen(carriage)))
    least = max(MARKER_LIMITS.min_frames, int(np.ceil(MARKER_LIMITS.min_seen_share * len(optical))))
    if used < least:
        raise RecordingError(
            f"{optical.path.name} (recording {recording.name}), marker {carriage}: found it in {used} of "
            f"{len(optical)} frames while the robot recorded, expected at least {least}"
        )
    return _Track(angle, optical.markers)


def _losses(optical: OpticalRecording, marker: str) -> tuple[int, float]:
    """Frames in which a marker was lost, and how long it was at most [s]."""
    lost = ~optical.seen(marker)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], lost, [False])).astype(np.int8)))
    last = len(lost) - 1
    spans = optical.time[np.minimum(edges[1::2], last)] - optical.time[edges[::2]]
    return int(lost.sum()), float(spans.max()) if spans.size else 0.0


def _usual_places(places: Sequence[Mapping[str, _Place]], carriages: set[str]) -> dict[str, np.ndarray]:
    """Where each marker of the segment sits in most recordings, shape (3,) [m]; three are needed for most."""
    names = {m for place in places for m in place} - carriages
    found = {m: [place[m].at for place in places if m in place] for m in names}
    return {m: np.median(at, axis=0) for m, at in found.items() if len(at) >= 3}


def _moved(place: Mapping[str, _Place], usually: Mapping[str, np.ndarray], carriage: str) -> dict[str, float]:
    distances = {m: float(np.linalg.norm(place[m].at - at)) for m, at in usually.items() if m in place}
    moved = {m: distance for m, distance in sorted(distances.items()) if distance > LIMITS.min_moved_distance_m}
    for marker, at in usually.items():
        # The carriage on another marker's place, while that one is elsewhere: they have swapped names.
        distance = float(np.linalg.norm(place[carriage].at - at))
        if distance < LIMITS.min_moved_distance_m and marker in moved:
            moved[carriage] = distance
    return moved


def _by_ruler(recording: Recording, height: float) -> Placement:
    assert recording.slider is not None  # a recording has a ruler's reading or an optical file
    return Placement(
        recording=recording.name,
        slider=float(recording.slider),
        height=height,
        slider_se=np.nan,
        height_se=np.nan,
        reason="a ruler told the place",
        file=recording.path.name,
        ruler=recording.slider,
    )
