"""Propose a study for given files: recordings of one layout, the roles of their columns, and open questions.

The proposal asks at most five questions, the most important first; each has a default.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, takewhile
from pathlib import Path

import numpy as np

from .._errors import StudyError, listed_names
from ..files.clock import first_deliveries
from ..files.defects.sensor_range import agrees_at_limit, sensor_ends
from ..files.file_facts import FileFact, find_drive_facts, find_encoder_counts, find_rate
from ..files.muscle_names import side_of_words
from ..files.name_evidence import (
    MACHINE_WORDS,
    NameEvidence,
    quantity_of_unit,
    read_name,
    with_stated_unit,
    words_of,
)
from ..files.recording import LOCKED_SPRING_PROTOCOL, MAXIMAL_PROTOCOL
from ..files.stated_units import scaled_unit_from_text, unit_from_text
from ..study.drive_channel import DRIVE_CHANNELS
from ..study.study_file import channel_unit, rig_units
from ..units import parse_quantity, to_si_factor
from .given_files import GivenFiles, GivenTable, trial_key
from .inference.angle_units import ANGLE_LIMITS, MAX_RADIAN_RANGE
from .inference.assign_roles import (
    DRIVE_QUANTITIES,
    LENGTH_UNITS,
    ROLE_LIMITS,
    ColumnRole,
    TableHints,
    TableRoles,
    assign_roles,
    is_known_unit,
)
from .inference.clocks import TIME_LIMITS, UNIT_SECONDS
from .inference.emg_spectrum import swings_fast
from .inference.encodings import decode_counts
from .inference.gears import FoundGear, find_gear
from .inference.locked_spring import LockedSpring, find_postures, spring_of_tables, with_locked_spring
from .inference.maximal_contractions import find_maximal_contractions
from .inference.motion_efforts import (
    DERIVATIVE_LIMITS,
    EFFORT_LIMITS,
    FULL_TURNS,
    UNIT_RATIOS,
    MotionSamples,
    RepeatedMotion,
    acceleration_scale,
    effort_share,
    find_repeated_motion,
    find_resting_limit,
    is_magnitude,
    is_possible_acceleration,
    is_reversed,
    is_usual_acceleration,
    motion_samples,
    weigh_turns,
)
from .inference.processing_choice import (
    ProcessingChoice,
    bridge_losses,
    choose_processing,
    cut_missing,
    find_lost_periods,
)
from .match_robot_joints import RobotJoints, joints_remarks, match_robot_joints
from .muscle_labels import muscle_questions, said_muscles, with_muscles, with_settled_muscles
from .proposal import (
    CHOSEN_KEYS,
    NO_ANSWERS,
    SAID_BY_LAB,
    UNKNOWN_SUPPLY,
    Layout,
    Proposal,
    ProposedRecording,
    Question,
    find_motor_turns,
    select_questions,
)


@dataclass(frozen=True)
class ProposalLimits:
    """Limits of a proposal: tables examined, recordings held out, and thresholds of its decisions."""

    # Rate that --yes takes and marks if no file states one and no spectrum shows it [Hz].
    default_rate_hz: float = 100.0
    # Largest number of recordings of a layout in which roles are looked for: a column that is constant in one may
    # move in another.
    max_representatives: int = 3
    # A joint moves if its speed is at least this share of its usual speed.
    min_moving_share: float = 0.1
    # Largest difference between the shares of forward motion in two parts of a recording that count as alike.
    max_direction_difference: float = 0.6
    # Smallest number of cells of one file that are examined together.
    min_pooled_tables: int = 20
    # Largest number of cells that are examined together.
    max_pooled_tables: int = 100
    # Largest number of recordings in a proposal.
    max_recordings: int = 400
    # Share of the recordings that is held out; of a single recording, its last part.
    held_out_share: float = 0.25
    # First share of a single recording that is used to fit.
    single_fit_share: float = 0.6
    # Largest relative difference between the rate that a lab states and the mean rate of coarse stamps. Chosen by
    # judgement.
    max_rate_difference: float = 0.05
    # Above this ratio between the speeds of the two parts, alternate pieces are held out instead of the last part.
    max_speed_ratio: float = 1.5
    # Quantile of a part's speeds that is compared.
    speed_quantile: float = 0.9
    # Smallest duration of a piece [s], so that filter transients and the start of a motion are a small part of it.
    min_piece_s: float = 2.0
    # Gravity acts on a joint if the sine of its angle explains this share of the effort in addition to inertia and
    # friction.
    min_gravity_share: float = 0.02
    # Largest share of the effort that inertia and friction leave unexplained in a friction map.
    max_unexplained_map: float = 0.1
    # Smallest number of recordings among which a repeated motion with another effort is looked for.
    min_times_compared: int = 2
    # A duty cycle with larger numbers is not a fraction of 1: it has a scale of its own.
    max_duty_share: float = 1.5
    # Usual numbers for 100 %: a byte, and tenths of a percent. The guess is the first that no sample exceeds.
    full_duties: tuple[float, ...] = (255.0, 1000.0)


PROPOSAL_LIMITS = ProposalLimits()

def propose_study(given: GivenFiles, name: str, answers: Mapping[str, str] | None = None) -> Proposal:
    """Return a proposal for files that were read; `answers` replace the defaults of questions by their keys."""
    answered = set(answers or {})
    # Who says that it is not known confirms no default.
    answers = {key: answer for key, answer in (answers or {}).items() if answer.strip() not in NO_ANSWERS}
    remarks: list[str] = []
    tables, paired = _pair_columns_with_sheets(given.tables)
    shows_people = _shows_people(tables)
    clock_unit = _clock_answer(answers)
    layouts = [_layout(group, shows_people=shows_people, clock_unit=clock_unit) for group in _grouped(tables)]
    about_muscles = is_about_muscles(layouts)
    if about_muscles:
        layouts = [_of_muscles(layout, remarks) for layout in layouts]
    layouts, doubtful = with_settled_muscles(layouts)
    layouts = _without_other_side(layouts, remarks)
    main = max(layouts, key=_merit)
    person = about_muscles or _is_person(main, layouts)
    others = [layout for layout in layouts if layout is not main]
    streams, recordings = _match(main, others, person, remarks)
    if paired:
        recordings = _with_paired_columns(recordings, main, paired)
        main = _with_paired_roles(main, paired)
    facts = {k: v for t in main.tables for k, v in find_drive_facts(t.facts).items()}
    main = _with_stated_counts(_with_rated_efforts(main, facts))
    streams = [_with_rated_efforts(stream, facts) for stream in streams]
    main = _with_measured_drive(main)
    drive = _drive_kind(main, streams) if not person else None
    spring = _locked_spring(main, drive)
    if spring is not None:
        main = replace(main, roles=with_locked_spring(main.roles, spring))
        recordings = [replace(r, protocol=LOCKED_SPRING_PROTOCOL) for r in recordings]
    turns = find_motor_turns(answers, facts)
    motion, motion_sure, gravity = _motion(main, drive, turns)
    if spring is not None:
        motion, gravity = ("rotary", "none") if _is_torque(main, drive) else (motion, "none")
    main = _in_metres(main) if motion == "prismatic" and not motion_sure else main
    main = _with_torque(main) if motion == "rotary" else main
    supply = next((f for layout in (main, *streams) if (f := _steady_supply(layout)) is not None), None)
    if supply is not None:
        facts.setdefault("supply", supply)
    main = _with_effort_signs(main, drive, remarks)
    main, limit = _with_limit(_with_full_duty(main), drive)
    if limit is not None:
        facts["limit"] = limit
    gear = find_gear(main.roles, ("torque",) if drive == "torque" else ())
    main = _with_gear(main, gear, answers, facts)
    # The same deflection with another torque is another spring, and no payload.
    repeated = _repeated(recordings, main, drive) if spring is None else None
    questions = list(
        _questions(main, streams, recordings, drive, facts, person, repeated, gravity, gear, bool(given.robots))
    )
    questions += muscle_questions(doubtful)
    possible = {question.key for question in questions}
    if unit_from_text(answers.get("position_unit", "")) == "counts" and "counts_per_turn" not in possible:
        questions.append(_counts_question(ANGLE_LIMITS.usual_counts))
        possible.add("counts_per_turn")
    if any(layout.roles.clock.column is not None for layout in layouts):
        possible.add("time_unit")
    if main.roles.clock.coarse_column is not None:
        possible.add("rate")
    if any(role.unit == "counts" and role.quantity in ("position", "motor_position") for role in main.channels):
        possible.add("counts_per_turn")  # who knows the encoder knows it better than the weight tells it
    unknown = answered - possible
    if unknown:
        known = ", ".join(question.key for question in questions)
        expected = f"expected answers to {known} alone" if known else "expected none: these files leave nothing open"
        raise StudyError(f"found an answer to {', '.join(sorted(unknown))}, {expected}")
    _require_chosen(questions, answers)
    if "muscles" in answers:
        said = said_muscles(answers["muscles"], doubtful)
        main, *streams = (with_muscles(layout, said) for layout in (main, *streams))
    main, streams, drive, motion, gravity, facts = _apply(answers, main, streams, drive, motion, gravity, dict(facts))
    if motion == "rotary" and gravity in (None, "none") and {"counts_per_turn", "position_unit"} & set(answers):
        gravity = _gravity(main, drive, turns)
    if duty_without_supply([main, *streams], drive, facts) is not None:
        facts["supply"] = UNKNOWN_SUPPLY
    main = _without_foreign_interactions(_with_counts_of_positions(main), motion)
    streams = [_without_foreign_interactions(stream, motion) for stream in streams]
    main, streams = _without_idle_unknowns(main, drive), [_without_idle_unknowns(s, drive) for s in streams]
    if about_muscles:
        recordings = _all_fitted(_with_held_contractions(recordings, main))
    else:
        recordings = _held_out(recordings, main)
    asked, marked = select_questions(questions)
    worn = answers.get("worn", next((q.default for q in questions if q.key == "worn"), "no")) == "yes"
    robot_joints = None if person else _robot_joints(given, main)
    remarks += _emg_remarks([main, *streams], drive, person)
    remarks += _remarks(given, main) + joints_remarks(given.robots, robot_joints, () if person else main.roles.joints)
    return Proposal(
        name=name,
        main=main,
        streams=tuple(streams),
        recordings=tuple(recordings[: PROPOSAL_LIMITS.max_recordings]),
        motion=motion,
        motion_is_certain=motion_sure,
        drive=drive,
        drive_facts=facts,
        gravity=gravity,
        is_person=person,
        is_worn=worn,
        asked=asked,
        marked=marked,
        answers=answers,
        processing=_processing(main, drive),
        given=given,
        remarks=tuple(dict.fromkeys(remarks)),
        repeated=repeated,
        robot_joints=robot_joints,
        spring=spring,
        doubtful_muscles=frozenset(doubtful),
    )


def _robot_joints(given: GivenFiles, main: Layout) -> RobotJoints | None:
    """Return how the recorded joints lie in a robot's file; None without one, or where a single joint was recorded."""
    if not given.robots:
        return None
    tables = [_own_names(t, main.tables[0]) for t in main.tables if len(t.columns) == len(main.tables[0].columns)]
    return match_robot_joints(given.robots[0], main.roles, tables)


def require_known_units(proposal: Proposal) -> None:
    """Raise a StudyError if a channel has a stated unit that is not known, and no answer that replaces it."""
    for layout in proposal.layouts:
        table, clock = layout.tables[0], layout.roles.clock.column
        stated = [(role.column, role.unknown_unit, _key_of_unit(role)) for role in layout.channels]
        if clock is not None:
            stated.append((clock, with_stated_unit(read_name(clock), table.units.get(clock)).unknown_unit or "", ""))
        for column, unit, key in stated:
            if not unit:
                continue
            answer = f"; or state the unit with --answer {key}=..." if key else ""
            raise StudyError(
                f'{table.path.name}: column "{column}": found the unknown unit "{unit}", expected a unit such as '
                f'"N*m", "N*mm", "deg", "rad/s" or "mA"{answer}'
            )


def _needs_gear(role: ColumnRole, proposal: Proposal) -> bool:
    """Whether a motor turns too often for a joint, and inertia and friction alone do not explain its effort.

    A map of friction on a dynamometer needs no angle of the joint.
    """
    main, table = proposal.main, proposal.main.tables[0]
    counts = float(str(role.keys.get("counts_per_turn", ANGLE_LIMITS.usual_counts)))
    per_radian = counts / (2.0 * np.pi) if role.unit == "counts" else 1.0 / to_si_factor(role.unit, None)[0]
    known = _in_unit(table, role)[: ROLE_LIMITS.max_analysed_rows]
    if np.ptp(known[np.isfinite(known)]) <= per_radian * MAX_RADIAN_RANGE:
        return False
    efforts = (r for r in main.channels if r.quantity in DRIVE_QUANTITIES and r.label == role.label)
    effort = next(efforts, None)
    if effort is None or main.roles.rate is None:
        return True
    motion = motion_samples(known, np.arange(len(known)) / main.roles.rate)
    weighed = weigh_turns(_decoded(table, effort)[: len(known)], motion, {"turn": 2.0 * np.pi * per_radian})
    return weighed is None or weighed.left_share("none") > PROPOSAL_LIMITS.max_unexplained_map


def require_turns_of_motors(proposal: Proposal) -> None:
    """Raise a StudyError if positions are motors' and nothing says how often a motor turns for a turn of its joint."""
    if "gear_turns" in proposal.answers:
        return
    gear = find_gear(proposal.main.roles, ("torque",) if proposal.drive == "torque" else ())
    if gear is not None and gear.efforts and proposal.main.roles.geared and not gear.is_named:
        motor, turns = next(iter(proposal.main.roles.geared.items()))
        raise StudyError(
            f'{proposal.main.tables[0].path.name}: column "{gear.efforts[0]}": found no side of the gear, although '
            f'"{motor}" turns {turns:.4g} times as far as the joint; expected the turns of the motor for a turn of the '
            f'joint if the torque is the motor\'s, and 1 if it is the joint\'s: --answer "gear_turns={turns:.4g}"'
        )
    if proposal.motor_turns != 1.0 or proposal.main.measures_joint:
        return
    motors = (r for r in proposal.main.channels if r.quantity == "motor_position")
    role = next((r for r in motors if _needs_gear(r, proposal)), None)
    if role is None:
        return
    raise StudyError(
        f'{proposal.main.tables[0].path.name}: column "{role.column}": found the position of a motor: its range is too '
        "large for a joint. Expected the gear ratio (motor turns per turn of the joint): --answer gear_turns=..."
    )


def require_agreeing_units(proposal: Proposal) -> None:
    """Raise a StudyError if stated units of a position and of its derivative disagree, or weight refutes a unit."""
    for layout in proposal.layouts:
        table, columns = layout.tables[0], {role.column: role for role in layout.channels}
        for pair in layout.roles.pairs:
            stated = [_unit_said(columns.get(column), table) for column in (pair.of, pair.by)]
            is_clear = abs(pair.correlation) > DERIVATIVE_LIMITS.min_correlation_without_units
            known = [ratio for of, by, ratio in UNIT_RATIOS if [of, by] == stated]
            fitting = [(of, by) for of, by in pair.units if of == stated[0] or by == stated[1]]
            if not is_clear or not known or not fitting or tuple(stated) in pair.units:
                continue
            ways = " or ".join(f'"{of}" with "{by}"' for of, by in fitting)
            answer = next((of for of, by in fitting if by == stated[1] and not columns[pair.of].unit_is_certain), None)
            said = "" if answer is None else f', or state the unit: --answer "position_unit={answer}"'
            raise StudyError(
                f'{table.path.name}: columns "{pair.of}" and "{pair.by}": found the units "{stated[0]}" and '
                f'"{stated[1]}", which contradict the data: "{pair.by}" is {pair.ratio:.4g} times the derivative of '
                f'"{pair.of}", expected {known[0]:.4g} times. These units agree with the data: {ways}. Correct one '
                f"unit in the file{said}"
            )
        refuted = next((role for role in layout.channels if role.fitting_unit), None)
        if refuted is not None and "position_unit" not in proposal.answers:
            raise StudyError(
                f'{layout.tables[0].path.name}: column "{refuted.column}": found the unit "{refuted.unit}" '
                f"({refuted.unit_why}), expected {refuted.fitting_unit}. Correct the unit in the file, or state it: "
                f'--answer "position_unit={refuted.fitting_unit}"'
            )


def require_possible_clock(proposal: Proposal) -> None:
    """Raise a StudyError if the motion refutes the unit of the clock, and another one makes it a usual one."""
    main, clock = proposal.main, proposal.main.roles.clock
    fitting = [unit for unit in UNIT_SECONDS if clock.column is not None and clock.would_be_usual(unit)]
    if clock.rate is None:
        return
    for unit in fitting:
        rate = clock.rate * UNIT_SECONDS[clock.unit] / UNIT_SECONDS[unit]
        for role, position, effort, motion in _moved_efforts(main, proposal.drive, rate):
            if position.unit == "counts":
                continue
            pushed = acceleration_scale(effort, motion)
            fits = None if pushed is None else pushed * to_si_factor(position.unit, None)[0]
            if fits is None or not is_usual_acceleration(fits):
                continue
            stated = fits * (clock.rate / rate) ** 2
            if is_possible_acceleration(stated):
                continue
            per = "m/s^2" if proposal.motion == "prismatic" else "rad/s^2"
            raise StudyError(
                f'{main.tables[0].path.name}: column "{clock.column}": found the unit "{clock.unit}", which gives '
                f'{clock.rate:.3g} samples a second; the usual size of "{role.column}" would then accelerate the joint '
                f'by {stated:.2g} {per}. Expected "{unit}", which gives usual values ({rate:.4g} Hz, {fits:.3g} '
                f'{per}). Correct the unit in the file, or state it: --answer "time_unit={unit}"'
            )
    if clock.is_impossible and "time_unit" not in proposal.answers:
        raise StudyError(
            f'{main.tables[0].path.name}: column "{clock.column}": found steps that are {clock.rate:.4g} Hz in '
            f"{clock.unit}, expected a clock of at most {TIME_LIMITS.possible_rates_hz[1]:.4g} Hz: state its unit with "
            f'--answer "time_unit={(fitting or ["s"])[-1]}"'
        )


def _clock_answer(answers: Mapping[str, str]) -> str | None:
    """Return the unit of the clock that the lab said; None if it said none."""
    if "time_unit" not in answers:
        return None
    unit = unit_from_text(answers["time_unit"])
    if unit not in UNIT_SECONDS:
        raise StudyError(f'time_unit: found "{answers["time_unit"]}", expected {" or ".join(UNIT_SECONDS)}')
    return unit


def _unit_said(role: ColumnRole | None, table: GivenTable) -> str | None:
    """Return the unit that the lab said, or else that the file states, of a channel; None if neither says one."""
    if role is None or role.unit_why == SAID_BY_LAB:
        return None if role is None else role.unit
    return with_stated_unit(read_name(role.column), table.units.get(role.column)).unit


def require_delivered_effort(proposal: Proposal) -> None:
    """Raise a StudyError if the only effort is a command that the drive does not deliver, as the lab says."""
    role = _commanded_effort(proposal.layouts, proposal.drive)
    if role is not None and proposal.answers.get("command_followed") == "no":
        raise StudyError(
            f'{proposal.main.tables[0].path.name}: no effort was recorded: found only "{role.column}", a '
            "command that the drive does not follow, expected a measured torque, force or current"
        )


def _require_chosen(questions: Iterable[Question], answers: Mapping[str, str]) -> None:
    """Raise a StudyError if an answer is none of the choices of its question, where it has no others."""
    for question in questions:
        answer = answers.get(question.key)
        if question.key in CHOSEN_KEYS and answer is not None and answer not in question.choices:
            raise StudyError(f'{question.key}: found "{answer}", expected {" or ".join(question.choices)}')


def _key_of_unit(role: ColumnRole) -> str:
    """Return the key of the question that says a role's unit."""
    if role.quantity in DRIVE_QUANTITIES:
        return "effort"
    keys = dict.fromkeys(("position", "angle", "motor_position"), "position_unit") | {"emg": "emg_unit"}
    return keys.get(role.quantity or "", "")


def _without_idle_unknowns(layout: Layout, drive: str | None) -> Layout:
    """Return a layout without efforts that drive nothing and whose stated unit is not known."""
    used = DRIVE_CHANNELS.get(drive or "", ())

    def known(role: ColumnRole) -> ColumnRole:
        is_idle = role.quantity in DRIVE_QUANTITIES and role.quantity not in used
        return replace(role, quantity=None, why=role.unit_why) if role.unknown_unit and is_idle else role

    return layout.with_each(known)


def _without_foreign_interactions(layout: Layout, motion: str) -> Layout:
    """Return a layout without efforts between robot and person that act on no joint of this motion: a strap's force on
    a joint that turns has a lever arm that no file states."""
    expected = "N*m" if motion == "rotary" else "N"

    def fitting(role: ColumnRole) -> ColumnRole:
        if role.quantity != "interaction" or is_known_unit(role.unit, expected):
            return role
        return replace(role, quantity=None, why=f"{role.why}; it is in {role.unit}, and the joint's are in {expected}")

    return layout.with_each(fitting)


def _locked_spring(main: Layout, drive: str | None) -> LockedSpring | None:
    """Return the spring on the bench that every recording of the main layout shows, None if they are of a joint."""
    effort = _main_effort([main], drive)
    if effort is None or main.tables[0].rows == 0:
        return None
    tables = [{n: np.asarray(x, float) for n, x in _own_names(t, main.tables[0]).items()} for t in main.tables]
    return spring_of_tables(main.roles, tables, effort[1])


def _is_torque(main: Layout, drive: str | None) -> bool:
    effort = _main_effort([main], drive)
    return effort is not None and effort[1].quantity == "torque" and effort[1].unit_is_certain


def _grouped(tables: Sequence[GivenTable]) -> list[list[GivenTable]]:
    groups: dict[tuple[object, ...], list[GivenTable]] = {}
    for table in tables:
        groups.setdefault(table.signature, []).append(table)
    return _with_supersets(_with_headless(list(groups.values())))


def _with_headless(groups: list[list[GivenTable]]) -> list[list[GivenTable]]:
    """Return groups in which tables without names stand behind those whose columns they continue.

    A logger that begins a new file now and then writes the names into the first one alone.
    """
    named: list[list[GivenTable]] = []
    headless: list[list[GivenTable]] = []
    for group in groups:
        (headless if all(name.isdigit() for name in group[0].columns) else named).append(list(group))
    for group in headless:
        continued = [other for other in named if all(_continues(table, other[0]) for table in group)]
        (continued[0].extend if len(continued) == 1 else named.append)(group)
    return named


def _continues(table: GivenTable, first: GivenTable) -> bool:
    """Whether a table may continue a named one: of as many columns, each within reach of its range, but for a clock."""
    if len(table.columns) != len(first.columns) or table.path.suffix != first.path.suffix or first.key:
        return False
    for (name, known), x in zip(first.columns.items(), table.columns.values(), strict=True):
        if read_name(name).quantity in ("time", "counter"):
            continue
        known, x = known[np.isfinite(known)], x[np.isfinite(x)]
        if known.size and x.size and not (x.min() <= known.max() and known.min() <= x.max()):
            return False
    return True


def _with_supersets(groups: list[list[GivenTable]]) -> list[list[GivenTable]]:
    """Return groups in which tables with further columns stand behind those that have the shared ones alone."""
    ordered = sorted(groups, key=lambda group: len(group[0].columns))
    made: list[list[GivenTable]] = []
    for group in ordered:
        names, about = set(group[0].columns), group[0].signature[1:3]
        for other in made:
            shared = set(other[0].columns)
            alike = len(shared) >= 3 and shared <= names and other[0].signature[1:3] == about
            if alike and not all(name.isdigit() for name in shared) and len(names) <= 2 * len(shared):
                other += group
                break
        else:
            made.append(list(group))
    return made


def _layout(group: Sequence[GivenTable], *, shows_people: bool, clock_unit: str | None = None) -> Layout:
    fewest = min(len(table.columns) for table in group)
    alike = [table for table in group if len(table.columns) == fewest]
    first, ranked = alike[0], sorted(alike, key=lambda table: -table.rows)[: PROPOSAL_LIMITS.max_representatives]
    rate_fact = find_rate(first.facts)
    hints = TableHints(
        units=first.units,
        angle_unit=first.angle_unit,
        rate=rate_fact.value if rate_fact else None,
        quantity=first.quantity,
        is_person=_names_people(first, shows_people=shows_people),
        shows_people=shows_people,
        joint=read_name(first.path.stem).joint,
        facts=first.facts,
        clock_unit=clock_unit,
    )
    if len(alike) >= PROPOSAL_LIMITS.min_pooled_tables and first.key:
        # Short cells of one file show quanta and ranges only together.
        pooled = [_own_names(table, first) for table in alike[: PROPOSAL_LIMITS.max_pooled_tables]]
        joined = {name: np.concatenate([own[name] for own in pooled]) for name in first.columns}
        return Layout(tuple(alike), _without_contradicted(assign_roles(joined, hints)), rate_fact=rate_fact)
    roles = assign_roles(_own_names(ranked[0], first), hints)
    for other in ranked[1:]:
        if len(other.columns) == len(first.columns):
            roles = _completed(roles, assign_roles(_own_names(other, first), hints))
    # The first table of a layout is the one whose columns the channels name.
    roles = _without_laboratory(_without_contradicted(roles), first)
    return Layout((first, *(table for table in group if table is not first)), roles, rate_fact=rate_fact)


LABORATORY_ENDINGS = (".c3d", ".edf", ".bdf", ".trc")
"""Endings of files of motion captures and amplifiers, which record no drive."""

_MARKER_AXIS = re.compile(r".*_[xyz]", re.IGNORECASE)
"""Name of a marker's coordinate."""

_COMPUTED_AXIS = re.compile(r".*(?:angle|moment|torque|power|force)s?\d*_[xyz]", re.IGNORECASE)
"""Name of an axis of what a model computed, which stands among the markers."""

_PLATE_CHANNEL = re.compile(r"plate\d+\..*|(?:F|M)[xyz]\d*|(?:force|moment)[._ ]?(?:F|M)?[xyz]?\d*", re.IGNORECASE)
"""Name of a channel of a force plate."""


def _without_laboratory(roles: TableRoles, table: GivenTable) -> TableRoles:
    """Return roles of a motion capture's or an amplifier's file without markers, force plates and other voltages."""
    if table.path.suffix.lower() not in LABORATORY_ENDINGS:
        return roles

    def kept(role: ColumnRole) -> ColumnRole:
        if role.quantity is None or role.quantity == "emg":
            return role
        unit = with_stated_unit(read_name(role.column), table.units.get(role.column)).unit
        why = ""
        axes = {f"{role.column[:-1]}{axis}" for axis in "xyz"}
        # Without a stated unit, three axes are a marker's, unless a model computed them.
        is_marker = unit in ("m", "mm", "cm") or (unit is None and axes <= set(table.columns))
        if _MARKER_AXIS.fullmatch(role.column) and is_marker and not _COMPUTED_AXIS.fullmatch(role.column):
            why = "a marker coordinate, not a joint's"
        elif _PLATE_CHANNEL.fullmatch(role.column):
            why = "a force plate's channel, not a joint's"
        elif role.quantity in ("voltage", "current", "duty"):
            why = "the voltage of an analog input, not a drive's"
        return replace(role, quantity=None, label="", why=why) if why else role

    return replace(roles, roles=tuple(map(kept, roles.roles)))


def accepted_units(role: ColumnRole) -> tuple[str, ...]:
    """Return the SI units that `check` accepts for a role's channel, of a joint that turns and of one that slides."""
    name = f"{role.quantity}.{role.label}" if role.label else str(role.quantity)
    rigs = ({"rig": {"motion": motion, "drive": {"kind": "torque"}}} for motion in ("rotary", "prismatic"))
    found = [channel_unit(plain, rig_units(rig), role.unit) for rig in rigs for plain in (name, str(role.quantity))]
    return tuple(dict.fromkeys(unit for unit in found if unit is not None))


COUNTED_QUANTITIES = ("position", "motor_position", "reference", "angle", "velocity")
"""Quantities of which study.toml converts counts."""


def has_accepted_unit(role: ColumnRole) -> bool:
    """Whether a role's unit can be converted to one that `check` accepts for its channel."""
    units = accepted_units(role)
    if role.unit in ("counts", "counts/s") and role.quantity in COUNTED_QUANTITIES:
        return True
    if not units:
        return True
    try:
        to_si_factor(role.unit, units)
    except StudyError:
        return False
    return True


def _without_contradicted(roles: TableRoles) -> TableRoles:
    """Return roles without those that only a name suggests and the column's own unit contradicts.

    An effort stays, because a study needs one; its unit is reported.
    """

    def kept(role: ColumnRole) -> ColumnRole:
        if role.quantity is None or role.quantity in DRIVE_QUANTITIES or has_accepted_unit(role):
            return role
        return replace(
            role, quantity=None, label="", why=f'{role.why}, but its unit "{role.unit}" is that of another quantity'
        )

    return replace(roles, roles=tuple(map(kept, roles.roles)))


def _own_names(table: GivenTable, named: GivenTable) -> dict[str, np.ndarray]:
    """Return a table's columns under the names of another table of its layout: cells of one file differ in their
    keys."""
    if set(named.columns) <= set(table.columns):
        return {name: table.columns[name] for name in named.columns}
    return dict(zip(named.columns, table.columns.values(), strict=True))


PERSON_ENDINGS = (".sto", ".mot", ".c3d", ".trc", ".osim")
"""File name endings of motion capture and musculoskeletal models."""

PERSON_WORDS = frozenset({"moment", "moments", "grf", "pelvis", "subtalar", "mtp"})
"""Words in the names of motion-capture channels that machines rarely use."""

MOVEMENT_WORDS = frozenset({
    "flexion", "extension", "abduction", "adduction", "dorsiflexion", "plantarflexion", "pronation", "supination",
    "tilt", "lumbar",
})  # fmt: skip
"""Words for joint movements. Wearable robots use them too, so that they mean a person only without an effort."""

MOMENT_WORDS = frozenset({"moment", "moments"})
"""Words for a person's moments that may also name the torque of a machine."""


def _shows_people(tables: Sequence[GivenTable]) -> bool:
    """Whether the files hold EMG, markers or a person: robots have hips, knees and arms, too."""
    for table in tables:
        # A file's or a project's name is told under "Name", too.
        personal = any(field.label.casefold() != "name" for field in table.personal)
        if table.path.suffix.lower() in PERSON_ENDINGS or personal or table.quantity in ("emg", "moment_arm"):
            return True
        found = [read_name(name) for name in table.columns]
        if any(e.muscle is not None or e.quantity == "emg" for e in found):
            return True
        known = PERSON_WORDS if any(map(_says_effort, found)) else PERSON_WORDS | MOVEMENT_WORDS
        words = set().union(*(known & set(words_of(e.bare)) for e in found))
        # Labs call the torque of one joint's bench a moment. Inverse dynamics gives those of several joints.
        if words - MOMENT_WORDS or (words and len({e.joint for e in found if e.joint is not None}) > 1):
            return True
    return False


def _says_effort(evidence: NameEvidence) -> bool:
    """Whether a name says an effort, also before the joint, as in effort.elbow_flexion."""
    words = set(words_of(evidence.bare)) & {"effort", "torque", "tau", "current", "force", "pwm", "voltage"}
    return evidence.quantity in DRIVE_QUANTITIES or bool(words)


def _names_people(table: GivenTable, *, shows_people: bool) -> bool:
    """Whether most columns are named after joints or muscles of people, as motion capture names them."""
    found = [read_name(name) for name in table.columns]
    persons = [e for e in found if not MACHINE_WORDS & set(words_of(e.bare))]
    named = [e for e in persons if e.joint is not None or e.muscle is not None]
    if any(e.quantity in ("current", "voltage", "duty") or e.is_command or e.is_machine for e in found):
        return False
    # A dynamometer or an orthosis turns a joint, and EMG stands beside it: its own columns name no joint.
    moved = [e for e in found if e.quantity in ("position", "torque", "force")]
    is_machine = (
        bool(moved)
        and table.quantity is None
        and not any(e.joint is not None or (PERSON_WORDS | MOVEMENT_WORDS) & set(words_of(e.bare)) for e in moved)
    )
    return shows_people and not is_machine and len(named) >= 0.4 * len(found)


def _completed(roles: TableRoles, other: TableRoles) -> TableRoles:
    """Return roles in which columns that were constant have the role that another recording shows."""
    shown = {role.column: role for role in other.roles}
    taken = {(role.quantity, role.label) for role in roles.roles}
    made = []
    for role in roles.roles:
        found = shown.get(role.column)
        constant = role.quantity is None and role.why.startswith("constant")
        if constant and found is not None and found.quantity and (found.quantity, found.label) not in taken:
            made.append(replace(found, why=f"{found.why}; it is constant in another recording"))
            taken.add((found.quantity, found.label))
        else:
            made.append(role)
    return replace(roles, roles=tuple(made))


def _merit(layout: Layout) -> float:
    quantities = {role.quantity for role in layout.channels}
    motion = 3.0 * bool(quantities & {"position", "angle", "motor_position"})
    inertial = 2.0 * any(q and q.endswith(".acceleration") for q in quantities)
    efforts = 2.0 * bool(quantities & {*DRIVE_QUANTITIES, "moment"})
    emg = 1.0 * ("emg" in quantities)
    clock = 0.5 * (layout.roles.clock.column is not None)
    size = min(len(layout.tables), 4) * 0.5 + 0.1 * np.log10(max(layout.tables[0].rows, 1))
    geometry = -3.0 * bool(quantities & {"length", "moment_arm", "lengthening"})
    return motion + inertial + efforts + emg + clock + size + geometry if quantities else -1.0


MACHINE_QUANTITIES = frozenset({"current", "voltage", "duty", "reference", "interaction"})
"""Quantities that a machine has and a person has not."""


def _is_person(main: Layout, layouts: Sequence[Layout]) -> bool:
    """Whether a person's joints were recorded, without a drive."""
    quantities = {role.quantity for layout in layouts for role in layout.channels}
    if quantities & MACHINE_QUANTITIES:
        return False
    own = {role.quantity for role in main.channels}
    return bool(own & {"angle", "moment"}) or ("emg" in own and not own & {"torque"}) or _is_inertial(main)


def is_about_muscles(layouts: Sequence[Layout]) -> bool:
    """Whether EMG was recorded, and no effort of a drive or of a joint: a study of muscles alone.

    The force of a contraction without motion is no effort of a joint.
    """
    quantities = {role.quantity for layout in layouts for role in layout.channels}
    efforts = quantities & {*DRIVE_QUANTITIES, "moment"}
    is_isometric = efforts == {"force"} and not quantities & {"position", "motor_position", "angle", "reference"}
    return "emg" in quantities and (not efforts or is_isometric)


def _of_muscles(layout: Layout, remarks: list[str]) -> Layout:
    """Return a layout of a study of muscles, which keeps EMG and the angles of the person only."""

    def is_of_muscles(role: ColumnRole) -> bool:
        # The position of a marker is no angle of a joint.
        return role.quantity in ("emg", "angle") or (role.quantity == "position" and not role.is_length)

    others = [r for r in layout.channels if not is_of_muscles(r)]
    if others:
        remarks.append(
            f"{layout.tables[0].path.name}: {len(others)} channels of inertial sensors, forces and other inputs are "
            "excluded, because no joint effort and motion were recorded with which to compare them"
        )
    taken: set[str] = set()

    def of_person(role: ColumnRole) -> ColumnRole:
        if role in others:
            return replace(role, quantity=None, label="", why="neither EMG nor an angle, which a study of muscles uses")
        if role.quantity != "position":
            return role
        label = read_name(role.column).joint or role.label or _own_quantity(role) or "joint"
        while label in taken:
            label += "_2"
        taken.add(label)
        return replace(role, quantity="angle", label=label)

    return layout.with_each(of_person)


def _side_of(role: ColumnRole) -> str:
    """Return the side of a body that a role's label says; "" if it says none."""
    return side_of_words(role.label.split("_"))


def _without_other_side(layouts: Sequence[Layout], remarks: list[str]) -> list[Layout]:
    """Return layouts without the angles and moments of the side of a person of which no EMG was recorded."""
    sides: dict[str, set[str]] = {"emg": set(), "angle": set(), "moment": set()}
    for role in (role for layout in layouts for role in layout.channels if role.quantity in sides):
        sides[str(role.quantity)].add(_side_of(role))
    own = "".join(sides["emg"]) if len(sides["emg"]) == 1 else ""
    if not own or own not in sides["angle"] | sides["moment"]:
        return list(layouts)
    other = "left" if own == "right" else "right"
    why = f"of the {other} side; EMG is of the {own} side only"

    def kept(role: ColumnRole) -> ColumnRole:
        is_other = role.quantity in ("angle", "moment") and _side_of(role) == other
        return replace(role, quantity=None, label="", why=why) if is_other else role

    made = [layout.with_each(kept) for layout in layouts]
    remarks += [
        f"{before.tables[0].path.name}: {count} angles and moments of the {other} side are excluded, because EMG is of "
        f"the {own} side only"
        for before, after in zip(layouts, made, strict=True)
        if (count := len(before.channels) - len(after.channels))
    ]
    return made


def _is_inertial(layout: Layout) -> bool:
    return any((role.quantity or "").endswith(".acceleration") for role in layout.channels) and not any(
        role.quantity in DRIVE_QUANTITIES for role in layout.channels
    )


def _match(
    main: Layout, others: Sequence[Layout], person: bool, remarks: list[str]
) -> tuple[list[Layout], list[ProposedRecording]]:
    """Return the layouts that become streams, and the recordings with their streams' tables."""
    names = _recording_names(main.tables)
    found: dict[str, dict[str, GivenTable]] = {n: {} for n in names.values()}
    streams: list[Layout] = []
    for layout in sorted(others, key=lambda other: -_merit(other)):
        if not layout.channels:
            _remark_left(layout, "none of its columns could be assigned to a channel", remarks)
            continue
        matched = {id(table): _table_of(table, layout, main) for table in main.tables}
        if not any(matched.values()):
            _remark_left(layout, "its columns differ from the recordings', and it belongs to none of them", remarks)
            continue
        stream = _stream_name(layout, {s.stream for s in streams}, person)
        streams.append(_named_plainly(replace(layout, stream=stream), main))
        for table in main.tables:
            other = matched[id(table)]
            if other is not None:
                found[names[id(table)]][stream] = other
    recordings = [
        ProposedRecording(
            names[id(table)],
            table,
            found[names[id(table)]],
            participant=_participant(table.path),
            condition=_condition(table.path, main.tables),
            protocol=_protocol(table.path),
            columns=_other_columns(table, main),
            extras=_extras(table, main),
        )
        for table in main.tables
    ]
    return streams, recordings


def _named_plainly(layout: Layout, main: Layout) -> Layout:
    """Return a stream whose position is no joint's under its own name: the recording itself has no motion."""
    if any(r.quantity in ("position", "angle", "motor_position") for r in main.channels):
        return layout

    def plain(role: ColumnRole) -> ColumnRole:
        bare = read_name(role.column).bare
        if role.quantity != "position" or role.label or not bare[:1].isalpha():
            return role
        return replace(role, quantity=_own_quantity(role))

    return layout.with_each(plain)


def _own_quantity(role: ColumnRole) -> str:
    """Return the name of a column as the first part of a channel's name; "" if it has no letter or digit."""
    return re.sub(r"[^a-z0-9]+", "_", read_name(role.column).bare.casefold()).strip("_")


def _remark_left(layout: Layout, why: str, remarks: list[str]) -> None:
    names = sorted({table.path.name for table in layout.tables})
    remarks.append(f"{listed_names(names, 4)}: excluded: {why}")


def _extras(table: GivenTable, main: Layout) -> tuple[ColumnRole, ...]:
    """Return channels of a table's further columns: EMG of a muscle, and all others under their own names."""
    more = set(table.columns) - set(main.tables[0].columns)
    if not more or not set(main.tables[0].columns) <= set(table.columns):
        return ()
    found = assign_roles(dict(table.columns), TableHints(units=table.units, angle_unit=table.angle_unit)).roles
    return tuple(
        role if role.quantity == "emg" else replace(role, quantity=_own_quantity(role) or "extra", label="")
        for role in found
        if role.column in more and role.quantity is not None
    )


def _other_columns(table: GivenTable, main: Layout) -> dict[str, str]:
    """Return the columns of a table that the first table of its layout names otherwise, as cells and sheets do."""
    first = main.tables[0]
    if set(first.columns) <= set(table.columns):
        return {}
    pairs = zip(first.columns, table.columns, strict=False)
    return {own: other for own, other in pairs if own != other}


def _table_of(table: GivenTable, layout: Layout, main: Layout) -> GivenTable | None:
    """Return the table of another layout that belongs to a recording's main table, None if none does."""
    candidates = layout.tables
    same = [other for other in candidates if other.path == table.path]
    if len(same) == 1:
        return same[0]
    key = trial_key(table.path)
    alike = [other for other in candidates if trial_key(other.path) == key]
    for found in (
        [o for o in alike if o.path.parent == table.path.parent],
        alike,
        [o for o in candidates if o.path.parent == table.path.parent] if _one_each(layout, main) else [],
    ):
        if len(found) == 1:
            return found[0]
    if len(candidates) == 1 and len(main.tables) > 1 and candidates[0].path.parent == table.path.parent:
        return candidates[0] if abs(_duration(layout) / (_duration(main) or 1.0) - 1.0) < 0.5 else None
    if len(candidates) == 1 and len(main.tables) == 1:
        return candidates[0] if _share_rows_or_time(layout, main) else None
    return None


def _one_each(layout: Layout, main: Layout) -> bool:
    """Whether each folder holds one table of both layouts."""
    own = [table.path.parent for table in main.tables]
    others = [table.path.parent for table in layout.tables]
    return len(set(own)) == len(own) and len(set(others)) == len(others)


def _duration(layout: Layout) -> float:
    """Return the duration of a layout's first table by its own clock [s], 0 if nothing tells it."""
    clock, rate, table = layout.roles.clock, layout.roles.rate, layout.tables[0]
    if clock.column is not None and clock.column in table.columns:
        time = clock.seconds(table.columns[clock.column])
        return float(np.nanmax(time) - np.nanmin(time))
    return table.rows / rate if rate else 0.0


def _share_rows_or_time(layout: Layout, main: Layout) -> bool:
    if layout.tables[0].rows == main.tables[0].rows:
        return True
    own, other = _duration(main), _duration(layout)
    return own > 0.0 and other > 0.0 and 0.5 < own / other < 2.0


def _stream_name(layout: Layout, taken: set[str], person: bool) -> str:
    quantities = [role.quantity for role in layout.channels if role.quantity]
    most = max(set(quantities), key=quantities.count)
    plain = {"emg": "emg", "moment": "moments", "torque": "torques", "length": "lengths", "moment_arm": "moment_arms"}
    name = plain.get(most, most.partition(".")[0])
    if most == "torque" and person:
        name = "moments"
    base, k = name, 2
    while name in taken:
        name, k = f"{base}_{k}", k + 1
    return name


def _recording_names(tables: Sequence[GivenTable]) -> dict[int, str]:
    """Return a name for each table, by what its path has that others lack."""
    unsafe = re.compile(r"[^A-Za-z0-9_.-]+")
    stems = [unsafe.sub("_", table.path.stem).strip("_.") or "recording" for table in tables]
    if len(set(stems)) < len(stems):
        shared = shared_folders([table.path for table in tables])
        folders = [unsafe.sub("_", "_".join(table.path.parent.parts[shared:])) for table in tables]
        stems = [f"{folder}_{stem}".strip("_") for folder, stem in zip(folders, stems, strict=True)]
    keys = [re.sub(r"[^A-Za-z0-9_-]+", "_", table.key).strip("_") if table.key else None for table in tables]
    names = [stem if key is None else f"{stem}_{key}" for stem, key in zip(stems, keys, strict=True)]
    made: dict[int, str] = {}
    for i, (table, name) in enumerate(zip(tables, names, strict=True)):
        own = name if names.count(name) == 1 else f"{name}_{i + 1}"
        made[id(table)] = own if own[0].isalnum() else f"r{own}"
    return made


def shared_folders(paths: Sequence[Path]) -> int:
    """Return how many of the folders from the root on all paths share."""
    levels = zip(*(path.parent.parts for path in paths), strict=False)
    return sum(1 for _ in takewhile(lambda level: len(set(level)) == 1, levels))


_PARTICIPANT_CODE = re.compile(
    r"(?:^|[_\s./-])(?:(?:sub|subj|subject|participant|patient|pilot|person|id)[_\s-]?(\d{1,3})|([PS]\d{1,3}))(?=$|[_\s./-])",
    re.IGNORECASE,
)


def _participant(path: Path) -> str | None:
    """Return the code of a participant that a file's name or its folders contain, such as P1; None if they contain
    none."""
    for text in (path.stem, *(parent.name for parent in list(path.parents)[:3])):
        match = _PARTICIPANT_CODE.search(text)
        if match is not None:
            return f"P{match[1]}" if match[1] else match[2].upper()
    return None


def _condition(path: Path, tables: Sequence[GivenTable]) -> str | None:
    """Return the folder that tells a recording's condition: several participants' recordings lie in each."""
    own = [p.name for p in list(path.parents)[:3] if _PARTICIPANT_CODE.search(p.name) is None]
    if _participant(path) is None or not own:
        return None
    near = [list(table.path.parents)[:3] for table in tables]
    every = {tuple(p.name for p in folders if _PARTICIPANT_CODE.search(p.name) is None)[:1] for folders in near}
    return own[0] if 1 < len(every) <= 6 else None


MAXIMAL_WORDS = frozenset({"mvc", "mvic", "mvcs", "maxcontraction", "maximal"})
"""Words of the names of recordings of maximal contractions."""

MAX_FOLDER_WORDS = 2
"""A folder of more words tells a study, and not what each of its recordings is."""


def _protocol(path: Path) -> str | None:
    folder = words_of(path.parent.name)
    if MAXIMAL_WORDS & {*words_of(path.stem), *(folder if len(folder) <= MAX_FOLDER_WORDS else ())}:
        return MAXIMAL_PROTOCOL
    words = [w for w in words_of(path.stem) if not w.isdigit() and _PARTICIPANT_CODE.search(w) is None]
    text = "_".join(words[:6])
    return text if re.fullmatch(r"[a-z][a-z0-9_]{1,60}", text) else None


def _with_held_contractions(recordings: Sequence[ProposedRecording], main: Layout) -> list[ProposedRecording]:
    """Return the recordings of EMG alone, with those marked as maximal contractions whose shape tells them as such."""
    emg = [role.column for role in main.channels if role.quantity == "emg"]
    if len(emg) < len(main.channels) or main.roles.rate is None:
        return list(recordings)
    made = list(recordings)
    for who in dict.fromkeys(r.participant for r in recordings):
        own = [i for i, r in enumerate(recordings) if r.participant == who]
        tables = [_own_names(recordings[i].table, main.tables[0]) for i in own]
        samples = [{c: columns[c] for c in emg if c in columns} for columns in tables]
        for place in find_maximal_contractions(samples, main.roles.rate):
            recording = made[own[place]]
            if recording.protocol != MAXIMAL_PROTOCOL:
                why = "a maximal contraction, by its shape: a muscle stays above its peaks in movement"
                made[own[place]] = replace(recording, protocol=MAXIMAL_PROTOCOL, why=why)
    return made


def _all_fitted(recordings: Sequence[ProposedRecording]) -> list[ProposedRecording]:
    """Return the recordings of a study without an effort: nothing is fitted, so that no test set is needed."""
    return [replace(recording, use="fit") for recording in recordings]


def _held_out(recordings: Sequence[ProposedRecording], main: Layout) -> list[ProposedRecording]:
    """Return the recordings with the test set marked: whole recordings if there are several, else the last part."""
    maximal = [r for r in recordings if r.protocol == MAXIMAL_PROTOCOL]
    if maximal:
        others = [r for r in recordings if r.protocol != MAXIMAL_PROTOCOL]
        why = "a maximal contraction, by its name: it scales the EMG envelopes and is not used to fit"
        return [*(replace(r, why=why) for r in maximal), *(_held_out(others, main) if others else ())]
    if len(recordings) == 1:
        return _split_single(recordings[0], main)
    count = max(1, round(PROPOSAL_LIMITS.held_out_share * len(recordings)))
    step = len(recordings) / count
    chosen = {len(recordings) - 1 - round(i * step) for i in range(count)}
    return [
        replace(r, use="validate", why="held out: used only to test the model") if i in chosen else r
        for i, r in enumerate(recordings)
    ]


def _split_single(recording: ProposedRecording, main: Layout) -> list[ProposedRecording]:
    clock, rate = main.roles.clock, main.roles.rate
    n = recording.table.rows
    if n < 200 or rate is None:
        return [recording]
    columns = _own_names(recording.table, main.tables[0])
    if clock.column is not None:
        values = clock.seconds(columns[clock.column])
        known = values[np.isfinite(values)]
        begin, end = float(known[min(clock.first_sound, len(known) - 1)]), float(known[-1])
    else:
        begin, end = 0.0, n / rate
    if not end > begin:
        return [recording]
    step = 1.0 / rate
    share = PROPOSAL_LIMITS.single_fit_share
    piece = (end - begin) / PIECES
    if piece >= PROPOSAL_LIMITS.min_piece_s and not _moves_alike(columns, main.roles, rate, share):
        why = "one recording whose speed changes: alternate pieces are held out to test the model"
        edges = [begin + i * piece for i in PIECE_EDGES] + [end + step]
        uses = ["validate" if i % 2 else "fit" for i in range(len(edges) - 1)]
        return [
            replace(recording, name=f"{recording.name}_{i + 1}", window=(edges[i], edges[i + 1]), use=use, why=why)
            for i, use in enumerate(uses)
        ]
    middle = begin + share * (end - begin)
    why = "one recording in two parts: the last part is held out to test the model"
    return [
        replace(recording, name=f"{recording.name}_first", window=(begin, middle), why=why),
        replace(recording, name=f"{recording.name}_last", window=(middle, end + step), use="validate", why=why),
    ]


PIECES = 9
"""Pieces of a single recording whose speeds change, as in a sweep or a map of speeds."""

PIECE_EDGES = (0, 1, 2, 4, 5, 7, 8)
"""Where pieces begin that are fitted and held out by turns: one of three is held out, and both ends are fitted."""


def _moves_alike(columns: Mapping[str, np.ndarray], roles: TableRoles, rate: float, share: float) -> bool:
    """Whether each joint moves as fast, and as much both ways, in the first `share` of a recording as in the rest."""
    for role in (*roles.of("position"), *roles.of("motor_position")):
        if role.column not in columns:
            continue
        values = decode_counts(columns[role.column], role.keys)[roles.clock.first_sound :]
        if len(values) < 200 or not np.isfinite(values).any():
            continue
        velocity = motion_samples(values, np.arange(len(values)) / rate).velocity
        parts = np.split(velocity, [round(share * len(velocity))])
        slow, fast = sorted(float(np.quantile(np.abs(part), PROPOSAL_LIMITS.speed_quantile)) for part in parts)
        if fast > PROPOSAL_LIMITS.max_speed_ratio * slow:
            return False
        moving = PROPOSAL_LIMITS.min_moving_share * fast
        forwards = [float(np.mean(part[np.abs(part) > moving] > 0.0)) if np.any(np.abs(part) > moving) else 0.5
                    for part in parts]  # fmt: skip
        if max(forwards) - min(forwards) > PROPOSAL_LIMITS.max_direction_difference:
            return False
    return True


def _drive_kind(main: Layout, streams: Sequence[Layout]) -> str | None:
    roles = [
        r for layout in (main, *streams) for r in layout.channels if r.quantity in DRIVE_QUANTITIES and not r.is_command
    ]
    if not roles:
        return None
    order = ("torque", "force", "current", "duty", "voltage")
    # A measured effort that is certain comes before one that a name only suggests.
    best = min(roles, key=lambda r: (not r.is_certain, not r.unit_is_certain, order.index(r.quantity or "torque")))
    return _drive_of(best.quantity)


def _drive_of(effort: str | None) -> str | None:
    """Return the kind of a drive by its effort."""
    return next((kind for kind, efforts in DRIVE_CHANNELS.items() if effort in efforts), None)


def _with_measured_drive(main: Layout) -> Layout:
    """Return a layout in which commanded torques and forces are no effort where a measured current explains the motion.

    A command may be that of a model without friction, and a drive need not deliver it; its current was measured.
    """
    driving = [r for r in main.channels if r.quantity in ("torque", "force")]
    commanded = [r.column for r in driving if read_name(r.column).is_command and not r.is_command]
    if not commanded or len(commanded) < len(driving):
        return main
    explained = [
        effort_share(effort, motion, 2.0 * np.pi / FULL_TURNS[position.unit] if position.unit in FULL_TURNS else None)
        for role, position, effort, motion in _moved_efforts(main, "current")
        if role.is_certain and not read_name(role.column).is_command
    ]
    if max(explained, default=0.0) < EFFORT_LIMITS.min_effort_share:
        return main

    def asked_for(role: ColumnRole) -> ColumnRole:
        why = f"{role.why}; it is a command, because a measured current explains the motion"
        if role.column not in commanded:
            return role
        return replace(role, quantity=f"desired_{role.quantity}", is_command=True, why=why)

    return main.with_each(asked_for)


def _main_effort(layouts: Sequence[Layout], drive: str | None) -> tuple[Layout, ColumnRole] | None:
    names = DRIVE_CHANNELS.get(drive or "", ())
    found = ((layout, r) for layout in layouts for r in layout.channels if r.quantity in names and not r.is_command)
    return next(found, None)


def _commanded_effort(layouts: Sequence[Layout], drive: str | None) -> ColumnRole | None:
    """Return the command that stands for an effort that was not measured; None if one was.

    A voltage or a duty cycle is what a drive sets; its current, force and torque may be others than the commanded ones.
    """
    found = _main_effort(layouts, drive) if drive in ("torque", "force", "current") else None
    return found[1] if found is not None and read_name(found[1].column).is_command else None


def duty_without_supply(
    layouts: Sequence[Layout], drive: str | None, facts: Mapping[str, FileFact]
) -> ColumnRole | None:
    """Return a drive's duty cycle for which neither a column nor a file states the supply voltage; None if none is."""
    channels = [role for layout in layouts for role in layout.channels]
    if drive != "voltage" or "supply" in facts or any(role.quantity == "voltage" for role in channels):
        return None
    supplied = {role.label for role in channels if role.quantity == "supply"}
    return next((role for role in channels if role.quantity == "duty" and role.label not in supplied), None)


def _motion(main: Layout, drive: str | None, turns: float) -> tuple[str, bool, str | None]:
    """Return whether the joint turns or slides, whether that is certain, and how gravity acts on it."""
    positions = [r for r in main.channels if r.quantity in ("position", "angle", "reference")]
    lengths = [r for r in positions if r.is_length]
    if lengths:
        return "prismatic", all(r.unit_is_certain for r in lengths), None
    if not positions or any(r.unit_is_certain for r in positions) or drive is None:
        sliding = [r for r in main.channels if r.quantity == "force" or r.unit in ("m/s", "mm/s", "cm/s")]
        turning = [r for r in main.channels if r.quantity == "torque" or r.unit in ("rad/s", "deg/s", "rpm", "turn/s")]
        if not positions and sliding and not turning:
            return "prismatic", False, None
        return "rotary", True, _gravity(main, drive, turns)
    if any(r.unit == "counts" for r in positions):
        return "rotary", False, _gravity(main, drive, turns)
    measured = [r for r in positions if r.quantity == "position"]
    gravity = _gravity(main, drive, turns)
    span = max((float(np.ptp(_in_unit(main.tables[0], r))) for r in measured), default=1.0)
    # Little travel without weight is a slide more often than a joint in a horizontal plane; it is asked.
    if gravity == "none" and len(measured) == 1 and 0.005 < span < 1.0:
        return "prismatic", False, None
    return "rotary", False, gravity


def _gravity(main: Layout, drive: str | None, turns: float) -> str | None:
    """Return the gravity term: ``"none"`` if the sine of the angle explains nothing of the effort, else with a free
    zero. A motor turns `turns` times for a turn of its joint."""
    found = _main_effort([main], drive)
    positions = [r for r in main.channels if r.quantity == "position"]
    positions = positions or [r for r in main.channels if r.quantity == "motor_position"]
    if not _measures_angle(main):
        # The integral of a velocity starts at 0, wherever the joint hangs.
        is_integrated = any(r.quantity == "velocity" and not r.is_command for r in main.channels)
        return "sine+cosine" if is_integrated and drive is not None else None
    if found is None or not positions or main.roles.rate is None:
        return "sine+cosine" if drive is not None else None
    role, table = positions[0], main.tables[0]
    if has_open_counts(role):
        return "sine+cosine"
    n = min(table.rows, ROLE_LIMITS.max_analysed_rows)
    motion = motion_samples(_in_unit(table, role)[:n], np.arange(n) / main.roles.rate)
    effort = _decoded(table, found[1])[:n]
    turn = FULL_TURNS.get(role.unit)
    if role.unit == "counts" and "counts_per_turn" in role.keys:
        turn = float(str(role.keys["counts_per_turn"]))
    if turn is not None and role.quantity == "motor_position":
        turn *= turns
    weighed = weigh_turns(effort, motion, {role.unit: turn}) if turn is not None else None
    if weighed is None:
        return "sine+cosine"
    gain = weighed.left_share("none") - weighed.left_share(role.unit)
    return "sine+cosine" if gain > PROPOSAL_LIMITS.min_gravity_share or weighed.beats(role.unit, "none") else "none"


def _measures_angle(main: Layout) -> bool:
    return any(r.quantity in ("position", "motor_position") for r in main.channels)


def _decoded(table: GivenTable, role: ColumnRole) -> np.ndarray:
    return decode_counts(table.columns[role.column], role.keys)


def _in_unit(table: GivenTable, role: ColumnRole) -> np.ndarray:
    """Return a position's numbers in the unit of its role, without jumps."""
    scale = 1.0 if role.unit == "counts" else role.scale
    return scale * _decoded(table, role)


def _in_metres(main: Layout) -> Layout:
    """Return a layout in which positions whose unit is a guess are in metres, since the joint seems to slide."""
    units = {"rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2", "deg": "m"}
    moving = ("position", "reference", "velocity", "acceleration", "desired_velocity")

    def slid(role: ColumnRole) -> ColumnRole:
        if role.quantity not in moving or role.unit_is_certain or role.unit not in units:
            return role
        why = "small travel and no effect of gravity: the joint seems to slide"
        return replace(role, unit=units[role.unit], unit_why=why)

    return main.with_each(slid)


def _with_full_duty(main: Layout) -> Layout:
    """Return a layout in which each duty cycle in whole numbers has a guess of the number that is 100 %."""

    def guessed(role: ColumnRole) -> ColumnRole:
        if role.quantity != "duty" or role.unit != "1" or role.unit_is_certain or "scale" in role.keys:
            return role
        largest = float(np.nanmax(np.abs(_decoded(main.tables[0], role))))
        full = next((full for full in PROPOSAL_LIMITS.full_duties if largest <= full), largest)
        return (
            replace(role, keys={**role.keys, "scale": 1.0 / full}) if largest > PROPOSAL_LIMITS.max_duty_share else role
        )

    return main.with_each(guessed)


SHARES_OF_RATED = {"%": 0.01, "permille": 0.001}
"""Units of efforts that drives state as a share of their rated one."""


def _with_rated_efforts(layout: Layout, facts: Mapping[str, FileFact]) -> Layout:
    """Return a layout in which torques and currents that are shares of the drive's rated one have its unit.

    Without a rated value, the effort keeps a scale of its own: one ampere stands for the rated effort.
    """

    def rated(role: ColumnRole) -> ColumnRole:
        quantity = (role.quantity or "").removeprefix("desired_")
        if quantity not in ("torque", "current", "force") or role.unit not in SHARES_OF_RATED:
            return role
        if quantity == "force":
            # Drives call their torque a load; of a force, a share is none of a sensor's units.
            quantity = "torque"
            role = replace(role, quantity=(role.quantity or "").replace("force", "torque"))
        share = SHARES_OF_RATED[role.unit] * role.scale
        fact = facts.get(f"rated_{quantity}")
        if fact is not None:
            keys = {**role.keys, "scale": share * fact.value}
            return replace(role, unit=fact.unit, keys=keys, unit_why=f'a fraction of "{fact.label}", {fact.text}')
        kind = "current" if quantity == role.quantity else "desired_current"
        why = f"a fraction of the rated {quantity}, which no file states: 1 A stands for 100 %"
        return replace(
            role, quantity=kind, unit="A", keys={**role.keys, "scale": share, "rated": quantity}, unit_why=why,
            unit_is_certain=False,
        )  # fmt: skip

    return layout.with_each(rated)


def _with_counts_of_positions(layout: Layout) -> Layout:
    """Return a layout in which speeds and commands in counts have the counts of a turn of their joint's position."""
    turns = {r.label: r.keys.get("counts_per_turn") for r in layout.channels if r.quantity == "position"}

    def counted(role: ColumnRole) -> ColumnRole:
        known = turns.get(role.label)
        if known is None or role.unit not in ("counts", "counts/s") or "counts_per_turn" in role.keys:
            return role
        return replace(role, keys={**role.keys, "counts_per_turn": known})

    return layout.with_each(counted)


def _with_stated_counts(layout: Layout) -> Layout:
    """Return a layout in which unknown counts per turn are those that a file states for its encoder.

    They stay a default, because such a line does not state whether the encoder is on the motor or on the joint.
    """
    fact = find_encoder_counts({k: v for table in layout.tables for k, v in table.facts.items()})
    if fact is None:
        return layout

    def counted(role: ColumnRole) -> ColumnRole:
        if not has_open_counts(role):
            return role
        why = f'the file states {fact.value:.12g} counts per turn in "{fact.label}"'
        keys = {**role.keys, "counts_per_turn": round(fact.value)}
        return replace(role, keys=keys, unit_why=why, unit_is_certain=False)

    return layout.with_each(counted)


def _force_on_lever(main: Layout, drive: str | None) -> ColumnRole | None:
    """Return a force in a stated unit that drives a joint which turns; None without one."""
    found = _main_effort([main], drive)
    places = [r for r in main.channels if r.quantity in ("position", "motor_position")]
    is_angle = any(not is_known_unit(r.unit, "m") for r in places)
    if found is None or found[1].quantity != "force" or not found[1].unit_is_certain or not is_angle:
        return None
    return found[1]


def require_rate(proposal: Proposal) -> None:
    """Raise a StudyError if a drive's motion has neither times nor a rate: no physics tells the scale of time."""
    if proposal.drive is None or all(layout.roles.rate is not None for layout in proposal.layouts):
        return
    raise StudyError(
        f"{proposal.main.tables[0].path.name}: found no column of times and no sampling rate, on which every speed and "
        'inertia depends, expected one of them: --answer "rate=500 Hz"'
    )


def require_lever_arm(proposal: Proposal) -> None:
    """Raise a StudyError if a force drives a rotary joint and its lever arm is unknown."""
    role = _force_on_lever(proposal.main, proposal.drive)
    if role is not None:
        raise StudyError(
            f'{proposal.main.tables[0].path.name}: column "{role.column}": found a force in {role.unit} on a rotary '
            'joint, expected a torque, or the lever arm of the force: --answer "lever_arm=0.3 m"'
        )


def _with_lever_arm(layout: Layout, lever: float) -> Layout:
    """Return a layout in which forces are torques at a `lever` [m]."""

    def turned(role: ColumnRole) -> ColumnRole:
        if role.quantity not in ("force", "desired_force"):
            return role
        scale = role.scale * to_si_factor(role.unit, "N")[0] * lever
        said = {**_said_unit("N*m"), "unit_why": f"a force at {lever:g} m from the axis"}
        quantity = role.quantity.replace("force", "torque")
        return replace(role, quantity=quantity, keys={**role.keys, "scale": scale}, **said)

    return layout.with_each(turned)


def _steady_supply(layout: Layout) -> FileFact | None:
    """Return the supply voltage that a column without any change holds; None if there is none."""
    for role in layout.roles.steady:
        if role.quantity == "supply":
            value = float(np.nanmean(layout.tables[0].columns[role.column])) * role.scale
            volts = value * to_si_factor(role.unit, "V")[0]
            if volts > 0.0:
                return FileFact(float(f"{volts:.6g}"), "V", f'"{role.column}"')
    return None


def _moved_efforts(
    main: Layout, drive: str | None, rate: float | None = None
) -> list[tuple[ColumnRole, ColumnRole, np.ndarray, MotionSamples]]:
    """Return the drive's efforts with the positions of their joints: both roles, the effort's numbers, the motion.

    The motion is that at another `rate` [Hz] than the table's, if one is given.
    """
    names, rate = DRIVE_CHANNELS.get(drive or "", ()), rate or main.roles.rate
    if rate is None:
        return []
    table, first = main.tables[0], main.roles.clock.first_sound
    rows = slice(first, first + ROLE_LIMITS.max_analysed_rows)
    positions = {r.label: r for r in main.channels if r.quantity in ("position", "motor_position")}
    found = []
    for role in main.channels:
        position = positions.get(role.label)
        if role.quantity not in names or role.is_command or position is None:
            continue
        values, effort = _in_unit(table, position)[rows], _decoded(table, role)[rows]
        if len(values) >= 200 and np.isfinite(values).any() and np.isfinite(effort).any():
            found.append((role, position, effort, motion_samples(values, np.arange(len(values)) / rate)))
    return found


def _with_effort_signs(main: Layout, drive: str | None, remarks: list[str]) -> Layout:
    """Return a layout in which an effort that counts against its joint's motion has the opposite sign.

    Inertia and friction are positive: an effort that shows both of them as negative was wired the other way round.
    """
    turned = {}
    for role, position, effort, motion in _moved_efforts(main, drive):
        if "sign" in role.keys or not is_reversed(effort, motion):
            continue
        why = f'it is positive against the direction of "{position.column}", so that its sign is reversed'
        remarks.append(f'"{role.column}": {why}; otherwise inertia and friction would be negative')
        turned[role.column] = replace(role, keys={**role.keys, "sign": -1}, why=f"{role.why}; {why}")
    return main.with_each(lambda role: turned.get(role.column, role))


def require_signed_effort(proposal: Proposal) -> None:
    """Raise a StudyError if an effort is the size of one, without its sign."""
    for role, position, effort, motion in _moved_efforts(proposal.main, proposal.drive):
        # A position slides, or its unit is another one: then gravity is constant, or part of what is left.
        turn = FULL_TURNS.get(position.unit)
        if is_magnitude(effort, motion, None if turn is None else 2.0 * np.pi / turn):
            raise StudyError(
                f'{proposal.main.tables[0].path.name}: column "{role.column}": found no negative number, but the '
                f'motion "{position.column}" needs an effort of both signs; expected the effort with its sign. Record '
                "the effort with its sign, or remove the column"
            )


def _with_limit(main: Layout, drive: str | None) -> tuple[Layout, FileFact | None]:
    """Return the layout and the drive's limit, if its channel rests at one; of a duty the limit is 100 %."""
    found = _main_effort([main], drive)
    if found is None or len(main.roles.joints) > 1:
        return main, None
    role = found[1]
    recordings = _decoded_alike(main, role)
    limit = find_resting_limit(recordings)
    if limit is None or not _is_drives_limit(main, role, recordings):
        return main, None
    said = f'"{role.column}" saturates at {limit:.6g} repeatedly'
    if role.quantity != "duty" or "scale" not in role.keys:
        return main, FileFact(limit, role.unit, said)
    scaled = {**role.keys, "scale": 1.0 / limit}
    main = main.with_changes(lambda r: r is role, keys=scaled, unit_why=f"{said}, which is taken as 100 %")
    return main, FileFact(100.0, "%", said)


def _is_drives_limit(main: Layout, role: ColumnRole, efforts: Sequence[np.ndarray]) -> bool:
    """Whether the largest number of an effort is the drive's limit, and not the end of its sensor's range.

    A torque or a force is measured, so that the motion must agree with its largest values. A current, a voltage and a
    duty are limited by their drive unless the motion shows that there was more.
    """
    position = next((r for r in main.channels if r.quantity in ("position", "motor_position")), None)
    rate = main.roles.rate
    is_measured = role.quantity in ("torque", "force")
    if position is None or rate is None:
        return not is_measured
    factor = to_si_factor(position.unit, None)[0] if position.unit != "counts" else 1.0
    motions = ([factor * x] for x in _decoded_alike(main, position))
    pairs = list(zip(efforts, motions, strict=True))
    if any(sensor_ends(effort, motion, rate) for effort, motion in pairs):
        return False
    return not is_measured or any(agrees_at_limit(effort, motion, rate) for effort, motion in pairs)


def _decoded_alike(main: Layout, role: ColumnRole) -> list[np.ndarray]:
    """Return the numbers of a role in each table that has as many columns as the first one."""
    alike = [t for t in main.tables if len(t.columns) == len(main.tables[0].columns)]
    return [_decoded(t, replace(role, column=main.column_in(t, role.column))) for t in alike]


def _with_torque(main: Layout) -> Layout:
    """Return a layout in which a force without a unit is a torque, since the joint turns: a load cell stands on a
    lever."""
    if not _measures_angle(main) or any(r.quantity == "torque" for r in main.channels):
        return main

    def turned(role: ColumnRole) -> ColumnRole:
        if role.quantity != "force" or role.unit_is_certain:
            return role
        return replace(
            role, quantity="torque", unit="N*m", unit_is_certain=False, unit_why="no unit is stated",
            is_certain=False, why=f"{role.why}, and a rotary joint needs a torque",
        )  # fmt: skip

    return main.with_each(turned)


def _repeated(recordings: Sequence[ProposedRecording], main: Layout, drive: str | None) -> RepeatedMotion | None:
    """Return the first pair of recordings that repeats a motion with another effort."""
    effort = _main_effort([main], drive)
    positions = [r for r in main.channels if r.quantity == "position"]
    if effort is None or not positions or len(recordings) < PROPOSAL_LIMITS.min_times_compared:
        return None
    # Only a joint that carries weight shows a payload; the joint with the largest effort does.
    efforts = [r for r in main.channels if r.quantity == effort[1].quantity]
    largest = max(efforts, key=lambda r: float(np.std(_decoded(main.tables[0], r))))
    position = next((r for r in positions if r.label == largest.label), positions[0])
    whole = [r for r in recordings if r.window is None][:12]
    own = [(r.name, _own_names(r.table, main.tables[0])) for r in whole]
    samples = [(name, table[position.column], table[largest.column]) for name, table in own]
    found = (find_repeated_motion(first, second) for first, second in combinations(samples, 2))
    return next((each for each in found if each is not None), None)


def _with_gear(main: Layout, gear: FoundGear | None, answers: Mapping[str, str], facts: dict[str, FileFact]) -> Layout:
    """Return a layout in which speeds and torques before a gear are those of the joint; `facts` then has its limit."""
    if gear is None:
        return main
    turns = _gear_turns(gear, answers, facts)

    def geared(role: ColumnRole) -> ColumnRole:
        if role.column in gear.speeds:
            times = gear.speeds[role.column]
            why = f"it is {times:.4g} times the joint's speed, as that of a motor before a gear"
            return _scaled(role, 1.0 / times, why)
        if role.column in gear.efforts and turns != 1.0:
            return _scaled(role, turns, f"a motor's torque, with a gear ratio of {turns:.6g}")
        return role

    found = _main_effort([main], "torque")
    if "limit" in facts and found is not None and found[1].column in gear.efforts:
        facts["limit"] = replace(facts["limit"], value=turns * facts["limit"].value)
    return main.with_each(geared)


def _scaled(role: ColumnRole, factor: float, why: str) -> ColumnRole:
    """Return a role of which one number is `factor` times as much as it was, and why."""
    keys = {**role.keys, "scale": factor * role.scale}
    return replace(role, keys=keys, why=f"{role.why}; {why}")


def _gear_turns(gear: FoundGear, answers: Mapping[str, str], facts: Mapping[str, FileFact]) -> float:
    """Return how often a motor turns for a turn of its joint where a torque is the motor's, and 1 where it is not."""
    if "gear_turns" in answers or (gear.is_named and "gear_ratio" in facts):
        return find_motor_turns(answers, facts)
    return gear.turns if gear.is_named else 1.0


def _questions(main, streams, recordings, drive, facts, person, repeated, gravity, gear, has_robot):
    """Yield the questions that only the lab can answer, with defaults."""
    layouts = [main, *streams]
    if any(layout.roles.rate is None for layout in layouts):
        # A drive's motion needs an answer: see `require_rate`.
        default, why = ("unknown", "the files do not show it") if drive is not None else _rate_guess(main)
        yield Question(
            "rate",
            "What is the sampling rate? No column is a time, and no file states the rate.",
            default,
            f"all speeds, filters and inertias; {why}",
        )
    if drive is not None:
        found = _main_effort(layouts, drive)
        kind = found[1].keys.get("rated") if found is not None else None
        if found is not None and kind is not None:
            yield Question(
                "rated",
                f'What is the rated {kind} of the drive, such as {"2.4 N*m" if kind == "torque" else "3.5 A"}? Column '
                f'"{found[1].column}" is a fraction of it.',
                "unknown",
                "whether results are in N*m or only relative to the rated effort",
            )
        elif found is not None and not (found[1].is_certain and found[1].unit_is_certain):
            role = found[1]
            yield Question(
                "effort",
                f'Which quantity does the column "{role.column}" hold, and in which unit?',
                f"{role.quantity} in {role.scaled_unit()}",
                f"whether results are torques ({role.why})",
                ("torque in N*m", "current in A", "voltage in V", "duty in 1", "force in N"),
            )
        asked_for = _commanded_effort(layouts, drive)
        if asked_for is not None:
            yield Question(
                "command_followed",
                f'Does the drive deliver the commanded effort "{asked_for.column}"? No measured effort was recorded.',
                "not certain",
                "every parameter: gain, limits and delay of the drive are attributed to the joint",
                ("yes", "no", "not certain"),
            )
    positions = [
        r for layout in layouts for r in layout.channels
        if r.quantity in ("position", "angle", "motor_position") and not r.is_command
    ]  # fmt: skip
    unsure = [r for r in positions if not r.unit_is_certain]
    counted = [r for r in positions if has_open_counts(r)]
    if counted and not any(r.unknown_unit for r in unsure):
        yield _counts_question(counted[0].keys.get("counts_per_turn", ANGLE_LIMITS.usual_counts))
    elif unsure:
        yield Question(
            "position_unit",
            f'In which unit is the position "{unsure[0].column}", an angle or a length?',
            unsure[0].unit,
            "inertia, gravity and friction, and whether efforts are torques or forces",
            ("deg", "rad", "turn", "counts", "m", "mm"),
        )
    if not main.measures_joint and any(r.quantity == "motor_position" for r in main.channels):
        yield Question(
            "gear_turns",
            "What is the gear ratio: how many motor turns make one turn of the joint (1 without a gear)? The positions "
            "are those of motors.",
            f"{find_motor_turns({}, facts):g}",
            "every angle, inertia and torque of the joints",
        )
    elif gear is not None and gear.efforts and not (gear.is_named and "gear_ratio" in facts):
        times = next(iter(gear.speeds.items()), None)
        seen = "" if times is None else f' "{times[0]}" is {times[1]:.4g} times the derivative of the position.'
        yield Question(
            "gear_turns",
            f'What is the gear ratio, if "{gear.efforts[0]}" is the torque of the motor and the position is the '
            f"joint's? Answer 1 if the torque is the joint's.{seen}",
            f"{_gear_turns(gear, {}, facts):.6g}",
            "the scale of all efforts and of every parameter",
        )
    if any(r.quantity == "duty" and "scale" in r.keys and not r.unit_is_certain for r in main.channels):
        yield Question(
            "full_duty",
            "Which number in the duty cycle's column stands for 100 %?",
            f"{1.0 / next(float(str(r.keys['scale'])) for r in main.channels if r.quantity == 'duty'):.6g}",
            "the scale of all efforts and of every parameter",
        )
    lever = _force_on_lever(main, drive)
    if lever is not None:
        yield Question(
            "lever_arm",
            f'At which distance from the axis does the force "{lever.column}" act, such as 0.3 m?',
            "unknown",
            "the torque about the joint and every parameter",
        )
    duty = duty_without_supply(layouts, drive, facts)
    if duty is not None:
        yield Question(
            "supply_voltage",
            f'What is the supply voltage of the drive, such as 12 V? The duty cycle "{duty.column}" is a fraction of '
            "it.",
            "unknown",
            "the scale of all efforts; if it is unknown, they are relative to the full duty cycle (as for 1 V)",
        )
    emg = [r for layout in layouts for r in layout.channels if r.quantity == "emg"]
    if any(not r.unit_is_certain for r in emg):
        yield Question(
            "emg_unit",
            "In which unit is EMG recorded?",
            next(r.unit for r in emg if not r.unit_is_certain),
            "reported amplitudes only; envelopes are relative to a maximum",
            ("V", "mV", "uV", "1", "%"),
        )
    hints = _worn_evidence(layouts, recordings)
    if not person and drive is not None:
        yield Question(
            "worn",
            "Was the robot worn during these recordings?",
            "yes" if hints else "no",
            "whether inertia and friction include the wearer's limb" + (f" ({hints})" if hints else ""),
            ("yes", "no"),
        )
    has_constant = bool({"torque_constant", "force_constant"} & set(facts))
    # The rated torque, which is asked for, is in N*m already.
    is_share_of_torque = any(r.keys.get("rated") == "torque" for layout in layouts for r in layout.channels)
    if drive in ("current", "voltage") and not has_constant and not is_share_of_torque:
        yield Question(
            "drive_constant",
            "What is the drive's constant at the "
            f"{'motor' if 'gear_ratio' in facts else 'joint, behind a gear'}, such as 0.06 N*m/A"
            + (", or one for each joint, such as 9, 7, 3 N*m/A?" if len(main.roles.joints) > 1 else "?"),
            "unknown",
            "whether results are in N*m or per ampere or volt (their units say which)",
        )
    if repeated is not None:
        yield Question(
            "payload",
            f"{repeated.heavier} repeats the motion of {repeated.lighter} with {repeated.ratio:.2f} times the effort. "
            "Which payload was carried, such as 2 kg at 0.3 m?",
            "unknown",
            "the drive's constant, which a known payload determines; a recording with an unknown payload must not be "
            "fitted together with the others",
        )
    # A robot's file has the zero of each joint.
    if gravity == "sine+cosine" and drive is not None and _measures_angle(main) and not has_robot:
        yield Question(
            "angle_zero",
            "Does the joint hang straight down at the angle 0?",
            "not certain",
            "whether the direction of gravity is estimated (two gravity parameters) or taken from the angle (one)",
            ("yes", "not certain"),
        )


def _counts_question(guess: object) -> Question:
    return Question(
        "counts_per_turn",
        "How many counts does the position have for one turn of the joint, gears included?",
        str(guess),
        "every angle, speed and inertia: all of them scale with it",
    )


def _rate_guess(main: Layout) -> tuple[str, str]:
    """Return a guess of the rate where nothing states it, with its reason: EMG is filtered to 500 Hz as a rule."""
    emg = [r for r in main.channels if r.quantity == "emg"]
    if not emg:
        default = f"{PROPOSAL_LIMITS.default_rate_hz:g} Hz"
        return default, "the files do not show it, and the default is only a placeholder"
    from scipy.signal import welch  # it loads all of scipy.stats

    edges = []
    for role in emg[:4]:
        x = main.tables[0].columns[role.column]
        x = x[np.isfinite(x)]
        frequency, power = welch(x - x.mean(), 1.0, nperseg=min(1024, len(x)))
        edges.append(float(frequency[np.searchsorted(np.cumsum(power), 0.95 * power.sum())]))
    edge = float(np.median(edges))
    best = min((1000.0, 1024.0, 1500.0, 2000.0, 2048.0, 4000.0), key=lambda rate: abs(np.log(edge * rate / 250.0)))
    return f"{best:g} Hz", f"95 % of EMG power usually lies below 250 Hz, here below {edge:.3g} times the sampling rate"


def _tells_wearer(table: GivenTable) -> bool:
    """Whether a file names a person who may wear the machine: a patient or subject, and not the experimenter."""
    return any(
        not person.is_of_staff and set(words_of(person.label)) - {"name", "a", "line"} for person in table.personal
    )


def _worn_evidence(layouts: Sequence[Layout], recordings: Sequence[ProposedRecording]) -> str:
    quantities = {role.quantity for layout in layouts for role in layout.channels}
    if "emg" in quantities:
        return "EMG was recorded with the drive"
    if "interaction" in quantities:
        return "an effort between machine and person was recorded"
    people = {r.participant for r in recordings if r.participant}
    if len(people) >= 2:
        return f"the file names show {len(people)} participants"
    if any(_tells_wearer(table) for layout in layouts for table in layout.tables):
        return "a file contains a person's name"
    return ""


def _apply(answers, main, streams, drive, motion, gravity, facts):
    """Return the proposal's parts with the answers in them."""
    if "rate" in answers:
        rate = parse_quantity(answers["rate"], "Hz", "rate")
        _require_agreeing_rate(main, rate)
        main, *streams = (_with_rate(layout, rate) for layout in (main, *streams))
    if answers.get("rated", "unknown") != "unknown":
        main, *streams = (_with_rated_answer(layout, answers["rated"]) for layout in (main, *streams))
        drive = _drive_kind(main, streams)
    if "effort" in answers:
        quantity, unit, scaled = _effort_answer(answers["effort"])
        found = _main_effort([main, *streams], drive)
        if found is not None:
            old = found[1].quantity

            def is_meant(role: ColumnRole) -> bool:
                return role.quantity == old and (role is found[1] or role.is_guess)

            said = {"quantity": quantity, "is_certain": True, **_said_unit(unit)}

            def answered(role: ColumnRole) -> ColumnRole:
                return replace(role, keys={**role.keys, **scaled}, **said) if is_meant(role) else role

            main, *streams = (layout.with_each(answered) for layout in (main, *streams))
            drive = _drive_of(quantity)
    if answers.get("lever_arm", "unknown") != "unknown":
        main = _with_lever_arm(main, parse_quantity(answers["lever_arm"], "m", "lever_arm"))
        drive = "torque"
    if "position_unit" in answers:
        unit = _position_answer(answers["position_unit"])
        motion = "prismatic" if unit in LENGTH_UNITS else "rotary"
        gravity = None if motion == "prismatic" else gravity or "sine+cosine"
        places = ("position", "reference", "angle", "motor_position")
        main = main.with_changes(lambda r: r.quantity in places and not r.unit_is_certain, **_said_unit(unit))
        main = _with_speeds_of(main, unit)
    if "full_duty" in answers:
        scale = 1.0 / parse_quantity(answers["full_duty"], "1", "full_duty")
        main = main.with_each(lambda r: _with_known_key(r, "scale", scale) if r.quantity == "duty" else r)
    if answers.get("supply_voltage", "unknown") != "unknown":
        facts["supply"] = FileFact(parse_quantity(answers["supply_voltage"], "V", "supply_voltage"), "V", SAID_BY_LAB)
    if "counts_per_turn" in answers:
        count = round(parse_quantity(answers["counts_per_turn"], "1", "counts_per_turn"))
        main = main.with_each(lambda r: _with_known_key(r, "counts_per_turn", count) if r.unit == "counts" else r)
    if "emg_unit" in answers:

        def is_open(role: ColumnRole) -> bool:
            return role.quantity == "emg" and not role.unit_is_certain

        said = _said_unit(answers["emg_unit"])
        main, *streams = (layout.with_changes(is_open, **said) for layout in (main, *streams))
    if re.search(r"[,;]\s*\d", answers.get("drive_constant", "")):
        main, drive = _with_drive_constants(main, answers["drive_constant"], drive, motion), "torque"
    elif answers.get("drive_constant", "unknown") != "unknown":
        expected = {"rotary": ("N*m/A", "N*m/V"), "prismatic": ("N/A", "N/V")}[motion]
        key = "torque_constant" if motion == "rotary" else "force_constant"
        si = expected[0] if drive == "current" else expected[1]
        facts[key] = FileFact(parse_quantity(answers["drive_constant"], si, "drive_constant"), si, SAID_BY_LAB)
    if answers.get("angle_zero") == "yes" and gravity == "sine+cosine":
        gravity = "sine"
    return main, streams, drive, motion, gravity, facts


def _require_agreeing_rate(layout: Layout, rate: float) -> None:
    """Raise a StudyError if the stamps of a coarse clock advance at another rate [Hz] than the lab says."""
    found = layout.roles.rate
    if found is not None and abs(rate / found - 1.0) > PROPOSAL_LIMITS.max_rate_difference:
        raise StudyError(
            f"rate: found {rate:.6g} Hz, but the stamps of \"{layout.roles.clock.coarse_column}\" advance at "
            f"{found:.6g} Hz on average, expected that rate within {100 * PROPOSAL_LIMITS.max_rate_difference:.3g} %"
        )


def _with_rate(layout: Layout, rate: float) -> Layout:
    """Return a layout with the rate that the lab says [Hz], where no column tells the time of each row."""
    roles = layout.roles
    if roles.rate is not None and roles.clock.coarse_column is None:
        return layout
    clock = replace(roles.clock, rate=rate, why=SAID_BY_LAB, is_certain=True) if roles.rate is not None else roles.clock
    return replace(layout, roles=replace(roles, rate=rate, clock=clock))


def _with_drive_constants(main: Layout, answer: str, drive: str | None, motion: str) -> Layout:
    """Return a layout in which each joint's current or voltage is a torque, by a drive constant for each joint."""
    si = f"{'N*m' if motion == 'rotary' else 'N'}/{'A' if drive == 'current' else 'V'}"
    names = DRIVE_CHANNELS.get(drive or "", ())
    efforts = [r for r in main.channels if r.quantity in names and not r.is_command]
    parts = [part.strip() for part in re.split(r"[,;]", answer)]
    unit = re.sub(r"^[-+.\de]+\s*", "", parts[-1])
    if len(parts) != len(efforts):
        raise StudyError(
            f'drive_constant: found {len(parts)} numbers in "{answer}", expected one number, or {len(efforts)}, for '
            f"{', '.join(role.column for role in efforts)}"
        )
    sizes = {
        role.column: parse_quantity(part if part.endswith(unit) else f"{part} {unit}", si, "drive_constant")
        for role, part in zip(efforts, parts, strict=True)
    }

    def turned(role: ColumnRole) -> ColumnRole:
        if role.column not in sizes:
            return role
        size = sizes[role.column] * to_si_factor(role.unit, si[-1])[0] * role.scale
        said = {**_said_unit("N*m" if motion == "rotary" else "N"), "keys": {**role.keys, "scale": size}}
        return replace(role, quantity="torque" if motion == "rotary" else "force", is_certain=True, **said)

    return main.with_each(turned)


def scale_reading(proposal: Proposal) -> str:
    """Return how the stored numbers of the driving effort were read, to follow a text; "" where they are the unit."""
    found = _main_effort(proposal.layouts, proposal.drive) if proposal.drive else None
    if found is None or found[1].scale == 1.0:
        return ""
    role = found[1]
    why = f" ({role.unit_why})" if role.unit_why else ""
    return f'; one count of "{role.column}" is already read as {role.scaled_unit()}{why}'


def _effort_answer(answer: str) -> tuple[str, str, dict[str, float]]:
    """Return the quantity, its unit and the scale of stored numbers, of an answer such as "current in 2.69 mA"."""
    quantity, _, text = answer.partition(" in ")
    scale, unit = scaled_unit_from_text(text) or (1.0, unit_from_text(text))
    units = {"torque": "N*m", "force": "N", "current": "A", "voltage": "V", "duty": "1"}
    expected = units.get(quantity.strip())
    if expected is None or unit is None or not is_known_unit(unit, expected):
        raise StudyError(
            f'effort: found "{answer}", expected a quantity ({", ".join(units)}) and its unit, such as "torque in '
            'lbf*in" or "current in mA", or the size of one stored number, such as "current in 2.69 mA"'
        )
    return quantity.strip(), unit, {} if scale == 1.0 else {"scale": scale}


def _with_rated_answer(layout: Layout, answer: str) -> Layout:
    """Return a layout in which shares of a rated effort have the unit of the rated effort that the lab said."""

    def rated(role: ColumnRole) -> ColumnRole:
        kind = role.keys.get("rated")
        if not isinstance(kind, str):
            return role
        unit = {"torque": "N*m", "current": "A"}[kind]
        value = parse_quantity(answer, unit, "rated")
        keys = {k: v for k, v in role.keys.items() if k != "rated"}
        keys["scale"] = float(str(role.keys["scale"])) * value
        quantity = kind if role.quantity == "current" else f"desired_{kind}"
        return replace(role, quantity=quantity, keys=keys, **_said_unit(unit))

    return layout.with_each(rated)


def _position_answer(answer: str) -> str:
    """Return the unit of a position that the lab said, as study.toml writes it."""
    unit = unit_from_text(answer)
    if unit is None or (unit != "counts" and quantity_of_unit(unit) != "position"):
        raise StudyError(f'position_unit: found "{answer}", expected "deg", "rad", "turn", "counts", "m" or "mm"')
    return unit


def _with_speeds_of(layout: Layout, unit: str) -> Layout:
    """Return a layout whose uncertain speed units follow from the position's unit, by the ratio of both.

    If motion and lab refute the stated unit of a position, a speed that agrees with it has the same mistake.
    """
    refuted = {role.column for role in layout.channels if role.fitting_unit and role.fitting_unit == unit}
    mistaken = {pair.by for pair in layout.roles.pairs if pair.of in refuted}
    ratios = {(of, by): ratio for of, by, ratio in UNIT_RATIOS}
    units = {}
    for pair in layout.roles.pairs:
        fitting = [(abs(abs(pair.ratio) / ratios[of, by] - 1.0), by) for of, by in pair.units if of == unit]
        if fitting:
            units[pair.by] = min(fitting)[1]

    def timed(role: ColumnRole) -> ColumnRole:
        is_open = not role.unit_is_certain or (role.column in mistaken and role.column in units)
        if role.quantity not in ("velocity", "desired_velocity") or not is_open:
            return role
        if role.column not in units:
            return replace(role, unit=f"{unit}/s", unit_why="the position's unit per second", unit_is_certain=True)
        keys = {key: value for key, value in role.keys.items() if key != "scale"}
        why = SAID_BY_LAB if role.unit_is_certain else "from its ratio to the position's derivative"
        return replace(role, unit=units[role.column], keys=keys, unit_why=why, unit_is_certain=True)

    return layout.with_each(timed)


def has_open_counts(role: ColumnRole) -> bool:
    """Whether a position is in counts and the counts per turn are uncertain."""
    return role.unit == "counts" and ("counts_per_turn" not in role.keys or not role.unit_is_certain)


def _said_unit(unit: str) -> dict[str, object]:
    """Return what changes in a role whose unit the lab said."""
    return {"unit": unit, "unit_why": SAID_BY_LAB, "unit_is_certain": True, "unknown_unit": ""}


def _with_known_key(role: ColumnRole, key: str, value: float) -> ColumnRole:
    return replace(role, keys={**role.keys, key: value}, unit_is_certain=True)


def _processing(main: Layout, drive: str | None) -> ProcessingChoice | None:
    """Return the processing of the main position; several joints share the highest low-pass."""
    positions, rate = [r for r in main.channels if r.quantity in ("position", "motor_position")], main.roles.rate
    if drive is None or not positions or rate is None or main.tables[0].rows < 200:
        return None
    first = main.roles.clock.first_sound
    missing = [_missing_rows(table, main, drive) for table in main.tables]
    starts = [first, *(0 for _ in main.tables[1:])]
    sampled = [
        _delivered_once(table, main, start) & ~rows[start:]
        for table, start, rows in zip(main.tables, starts, missing, strict=True)
    ]
    lost = [
        _lost_periods(table, main, positions[0], start, rows)
        for table, start, rows in zip(main.tables, starts, sampled, strict=True)
    ]
    once = slice(None) if lost[0] is None else sampled[0]
    choices = [choose_processing(_decoded(main.tables[0], role)[first:][once], rate, lost[0]) for role in positions]
    choice = max(choices, key=lambda choice: choice.lowpass)
    periods = [periods for periods in lost if periods is not None]
    choice = bridge_losses(choice, periods, rate) if periods else choice
    return cut_missing(choice, missing, rate)


def _missing_rows(table: GivenTable, main: Layout, drive: str) -> np.ndarray:
    """Return the rows in which a table lacks a position or an effort, shape (n,) bool."""
    read = {"position", "motor_position", *DRIVE_CHANNELS.get(drive, (drive,))}
    names = [r.column for r in main.channels if r.quantity in read and r.column in table.columns]
    return np.any([~np.isfinite(table.columns[name]) for name in names] or [np.zeros(table.rows, bool)], axis=0)


def _lost_periods(
    table: GivenTable, main: Layout, position: ColumnRole, first: int, rows: np.ndarray
) -> np.ndarray | None:
    """Return how many sampling periods lie between a table's `rows`, of those from the `first` on, shape (m - 1,).

    None unless samples are lost.
    """
    clock, rate = main.roles.clock, main.roles.rate
    needed = (position.column,) if clock.column is None else (position.column, clock.column)
    if rate is None or any(name not in table.columns for name in needed):
        return None
    time = np.arange(table.rows) / rate if clock.column is None else clock.seconds(table.columns[clock.column])
    return find_lost_periods(time[first:][rows], _decoded(table, position)[first:][rows], rate)


def _delivered_once(table: GivenTable, main: Layout, first: int) -> np.ndarray:
    """Return which rows, from the `first` on, do not repeat the packet before them, as a study leaves them out."""
    clock = main.roles.clock
    if clock.column not in table.columns:
        return np.ones(table.rows - first, bool)
    time = clock.seconds(table.columns[clock.column])[first:]
    clocks = (clock.column, *clock.others)
    return first_deliveries(time, {name: x[first:] for name, x in table.columns.items() if name not in clocks})


def _remarks(given: GivenFiles, main: Layout) -> list[str]:
    said = []
    for path, why in given.unread:
        if path.suffix.lower() not in (".md", ".pdf", ".py") and not path.name.casefold().startswith(
            ("license", "readme")
        ):
            said.append(f"{path.name}: not read: {why}")
    for table in given.tables:
        for person in table.personal:
            said.append(
                f"{table.path.name}: {person.place} identifies a person ({person.kind}). The study does not contain "
                "it, but the copy of the file does: remove it before you share the study"
            )
    for table in main.tables:
        role = next((r for r in main.channels if r.quantity == "position" and r.column in table.columns), None)
        if role is not None and main.roles.rate:
            held = find_postures(_decoded(table, role), main.roles.rate)
            if held.is_static:
                said.append(
                    f"{table.path.name}: the joint holds {len(held.positions)} postures and is at rest for "
                    f"{100 * held.still_share:.0f} % of the time; identify uses these holds to estimate gravity"
                )
    if main.roles.clock.first_sound:
        said.append(
            f"{main.tables[0].path.name}: the first {main.roles.clock.first_sound} rows are excluded, because time "
            "jumps back after them (old samples of a buffer)"
        )
    return said


def _emg_remarks(layouts: Sequence[Layout], drive: str | None, person: bool) -> list[str]:
    """Return how to state that a torque with EMG is a person's, where nothing but its name makes it a machine's."""
    quantities = {role.quantity for layout in layouts for role in layout.channels}
    if person or drive is None or "emg" not in quantities or quantities & MACHINE_QUANTITIES:
        return []
    return [
        "EMG was recorded with an effort, taken for that of a machine. To estimate torque from EMG, name angle and "
        'torque after the joint, as in "knee_angle [deg]" and "knee_torque [N*m]"'
    ]


def _pair_columns_with_sheets(
    tables: Sequence[GivenTable],
) -> tuple[list[GivenTable], dict[Path, tuple[GivenTable, dict[str, str]]]]:
    """Return the tables, and sheets whose columns belong to one other sheet each, by their file.

    In a workbook with one sheet of EMG for each task, the sheet with one column for each task holds the other
    measurements.
    """
    by_file: dict[Path, list[GivenTable]] = {}
    for table in tables:
        if table.key:
            by_file.setdefault(table.path, []).append(table)
    paired: dict[Path, tuple[GivenTable, dict[str, str]]] = {}
    left: list[GivenTable] = []
    for path, group in by_file.items():
        for sheet in group:
            rest = [other for other in group if other is not sheet]
            if len(rest) < 2 or len(sheet.columns) != len(rest):
                continue
            ends = [_last_number(x) for x in sheet.columns.values()]
            fits = all(abs(end - other.rows) <= 1 for end, other in zip(ends, rest, strict=True))
            if fits and len({len(other.columns) for other in rest}) == 1 and _is_slower(sheet, rest):
                paired[path] = (sheet, {other.key: name for other, name in zip(rest, sheet.columns, strict=True)})
                left.append(sheet)
                break
    return [table for table in tables if table not in left], paired


def _last_number(values: np.ndarray) -> int:
    known = np.flatnonzero(np.isfinite(values))
    return int(known[-1]) + 1 if known.size else 0


def _is_slower(sheet: GivenTable, others: Sequence[GivenTable]) -> bool:
    """Whether no column of a sheet swings from sample to sample, and most of the others' do, as EMG does."""
    own = [swings_fast(x) for x in sheet.columns.values()]
    rest = [swings_fast(x) for other in others for x in other.columns.values()]
    return not any(own) and 2 * sum(rest) > len(rest)


def _with_paired_columns(recordings, main, paired) -> list[ProposedRecording]:
    made = []
    for recording in recordings:
        found = paired.get(recording.table.path)
        column = found[1].get(recording.table.key) if found else None
        first = paired.get(main.tables[0].path)
        own = first[1].get(main.tables[0].key) if first else None
        if column is not None and own is not None and column != own:
            recording = replace(recording, columns={**recording.columns, own: column})
        made.append(recording)
    return made


def _with_paired_roles(main: Layout, paired) -> Layout:
    sheet, columns = paired.get(main.tables[0].path, (None, {}))
    column = columns.get(main.tables[0].key)
    if sheet is None or column is None:
        return main
    stated = read_name(column).unit
    role = ColumnRole(
        column, "force", stated or "N",
            f'the sheet "{sheet.key}" has one column for each sheet of EMG, of the same length',
            "the file states it" if stated else "the file does not state it",
        is_certain=False, unit_is_certain=stated is not None,
    )  # fmt: skip
    labels = _labels_by_sheet(main)
    roles = tuple(replace(r, label=labels.get(r.column, r.label)) for r in main.roles.roles)
    return replace(main, roles=replace(main.roles, roles=(*roles, role)))


def _labels_by_sheet(main: Layout) -> dict[str, str]:
    """Return muscles for numbered columns where the sheets are named after as many muscles, in their order."""
    first = main.tables[0]
    sheets = [t for t in main.tables if t.path == first.path]
    muscles = [read_name(re.split(r"[_\s.]", t.key)[-1]).muscle for t in sheets]
    if len(sheets) != len(first.columns) or None in muscles:
        return {}
    return {name: muscle for name, muscle in zip(first.columns, muscles, strict=True) if muscle}
