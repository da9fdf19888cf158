"""Read from a column's name what it may be: a quantity, a unit, and a joint or a muscle. Numbers then confirm or
refute it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from ..units import to_si_factor
from .muscle_names import MuscleLabel, find_muscle
from .stated_units import ends_in_multiple, scaled_unit_from_text, split_unit, stated_unit_text, unit_from_text

QUANTITY_WORDS = {
    "time": {"time", "t", "ts", "timestamp", "stamp", "clock", "zeit", "tiempo", "temps", "tempo", "elapsed", "tijd",
        "datetime", "epoch", "uptime", "sec", "secs", "millis", "micros"},
    "counter": {"counter", "count", "sample", "samples", "number", "index", "idx", "seq", "frame", "row", "packet",
        "no", "nr"},
    "position": {"position", "pos", "angle", "q", "theta", "th", "enc", "encoder", "deg", "winkel", "angulo", "phi",
        "rotation", "goniometer", "gonio", "flexion", "qj", "ang", "x", "displacement", "disp", "stroke", "travel",
        "jointangle", "qpos", "posizione", "posición", "posicion", "posição", "angolo", "ángulo", "ângulo", "hoek"},
    "velocity": {"velocity", "vel", "speed", "omega", "dq", "qd", "qdot", "dtheta", "v", "rate", "geschwindigkeit",
        "drehzahl", "qvel", "spd", "thetadot", "w", "velo", "dqj", "vitesse", "velocità", "velocidad",
        "velocidade", "snelheid"},
    "acceleration": {"ddq", "qdd", "qddot", "alpha", "angacc", "qacc"},
    "torque": {"torque", "tau", "trq", "tq", "moment", "drehmoment", "mom", "effort", "eff", "couple", "par", "tauj",
        "torsion", "coppia", "koppel"},
    "force": {"force", "load", "loadcell", "kraft", "fx", "fy", "fz", "thrust", "f", "dynamometer", "grf", "fuerza",
        "cable", "tension", "forza", "força", "kracht"},
    "current": {"current", "i", "cur", "curr", "strom", "amps", "iq", "amp", "imotor", "corriente", "ampere",
        "courant", "corrente", "stroom"},
    "voltage": {"voltage", "volt", "volts", "u", "vin", "spannung", "um", "umotor"},
    "duty": {"duty", "pwm"},
    "supply": {"supply", "battery", "vbus", "bus", "busvoltage", "vbat", "inputvolts"},
    "temperature": {"temperature", "temp", "temperatur", "tmp"},
    "enabled": {"enabled", "enable", "on"},
    "emg": {"emg", "semg", "muscle", "electromyogram", "emgs"},
    "linear_acceleration": {"acc", "accel", "accelerometer", "acceleration", "ax", "ay", "az", "linacc"},
    "angular_velocity": {"gyr", "gyro", "gyroscope", "gx", "gy", "gz", "angvel", "rotrate"},
    "magnetic_field": {"mag", "magnetometer", "mx", "my", "mz"},
    "orientation": {"quat", "quaternion", "qw", "qx", "qy", "qz", "orientation"},
    "error": {"error", "err"},
    "stiffness": {"stiffness", "kp"},
    "damping": {"damping", "kd"},
    "state": {"state", "status", "flag", "mode", "phase", "trigger", "sync", "digital", "digitals", "event", "label"},
}  # fmt: skip
"""Words of names, folded, by the quantity that they stand for."""

COMMAND_WORDS = frozenset({
    "ref", "reference", "des", "desired", "cmd", "command", "commanded", "goal", "target", "setpoint", "sp", "set",
        "soll",
    "demand", "demanded", "planned", "asked", "applied", "qr", "qref", "qdes", "nominal", "consigne", "desire",
    "taucmd", "icmd", "limited", "setpunkt", "vorgabe", "consignes", "commande", "référence", "cible", "riferimento",
    "comando", "comandato", "comandata", "desiderato", "desiderata", "consigna", "referencia", "deseado", "deseada",
    "objetivo", "referência", "desejado", "desejada", "alvo", "referentie", "gewenst", "gewenste", "börvärde",
})  # fmt: skip
"""Words of names that mark a command rather than a measurement; a drive follows its limited command."""

INSTRUMENT_WORDS = frozenset({
    "encoder", "sensor", "imu", "transducer", "loadcell", "goniometer", "gonio", "potentiometer", "dynamometer",
    "tachometer", "resolver", "geber", "capteur", "sensore", "codeur",
})  # fmt: skip
"""Words of instruments; with one of them, "reference" names a measurement (a reference encoder), not a command."""

COMMAND_PARTS = (
    "指令", "目标", "目標", "期望", "给定", "給定", "设定", "設定", "命令", "参考", "목표", "지령", "명령", "설정",
    "задан", "целев",
)  # fmt: skip
"""Parts of names that mark a command in languages that write several words as one."""

COMPUTED_WORDS = frozenset({"error", "err", "feedforward", "feedback", "ff", "fb", "gain", "estimated", "model"})
"""Words of names that mark a column as computed from others."""

MEASURED_WORDS = frozenset({
    "measured", "meas", "actual", "act", "sensor", "present", "ist", "istwert", "gemessen",
    "mesuré", "mesurée", "mesure", "misurato", "misurata", "effettivo", "effettiva", "medido", "medida", "ärvärde",
})  # fmt: skip
"""Words of names that mark a column as measured."""

MEASURED_PARTS = (
    "实测", "實測", "实际", "實際", "反馈", "反饋", "测量", "測量", "測定", "実測", "現在", "検出", "실측", "측정",
    "현재", "실제", "фактич", "измерен",
)  # fmt: skip
"""Parts of names that mark a column as measured, in languages that write several words as one."""

QUANTITY_PARTS = {
    "time": ("时间", "時間", "時刻", "시간", "시각", "время"),
    "acceleration": ("加速度", "가속도", "ускорение"),
    "velocity": ("速度", "转速", "轉速", "속도", "скорость"),
    "torque": ("力矩", "扭矩", "转矩", "轉矩", "トルク", "토크", "момент"),
    "current": ("电流", "電流", "전류"),
    "voltage": ("电压", "電壓", "電圧", "전압", "напряжение"),
    "temperature": ("温度", "溫度", "온도", "температура"),
    "force": ("荷重", "推力", "하중"),
    "position": ("角度", "位置", "转角", "轉角", "각도", "위치", "угол", "положение"),
}  # fmt: skip
"""Parts of names that stand for quantities in languages that write several words as one; the first that fits counts."""

LANGUAGE_PARTS = frozenset(
    {*COMMAND_PARTS, *MEASURED_PARTS, *(part for each in QUANTITY_PARTS.values() for part in each)}
)
"""Parts of names in scripts other than Latin; a text in the wrong encoding contains none of them."""

INTERACTION_WORDS = frozenset({"interaction", "human", "user", "contact", "cuff", "strap", "wearer"})
"""Words of names that mark an effort between robot and person."""

MACHINE_WORDS = frozenset({
    "actuator", "exo", "exoskeleton", "exosuit", "orthosis", "prosthesis", "motor", "robot", "drive", "device",
})  # fmt: skip
"""Words of names that mark an effort as a machine's rather than a muscle's."""

JOINT_WORDS = (
    "hip", "knee", "ankle", "shoulder", "elbow", "wrist", "finger", "thumb", "lumbar", "pelvis", "subtalar", "mtp",
    "neck", "trunk", "l5_s1", "l4_l5", "l3_l4", "l2_l3", "l1_l2", "l1_t12",
)  # fmt: skip
"""Joints of people, as names of columns contain them."""

HUMAN_JOINT_SUFFIXES = ("flexion", "extension", "abduction", "adduction", "rotation", "bending", "tilt", "flex_ext")
"""Words that name a direction of a person's joint, not one of a robot's."""

_DIRECTIONS_ONLY = frozenset(HUMAN_JOINT_SUFFIXES) - QUANTITY_WORDS["position"]
"""Directions that say no quantity."""

_REMARK_WORDS = frozenset({
    "left", "right", "l", "r", "x", "y", "z", "w", "raw", "filtered", "filt", "filter", "lowpass", "smoothed", "mean",
    "rms", "abs", "max", "min", "avg", "average", "motor", "joint", "link", "output", "input", "side", "id", "ch",
    "channel", "chan", "axis", "analog", "adc", "est", "estimate", "sim", "simulated", "norm", "normalised",
    "normalized", "relative", "corrected", "calibrated", "signed", "unsigned", "old", "new", "local", "global", "body",
    "world", "base", "foot", "shank", "thigh", "leg", "hand", "forearm", "upper", "lower", "proximal", "distal",
    "medial", "lateral", "anterior", "posterior", "front", "back", "utc", "gmt", "unix", "robot", "host",
})  # fmt: skip
"""Words in brackets that describe a column other than by its quantity."""

OTHER_QUANTITY_WORDS = {
    "length": {"length", "lmt", "mtlength"},
    "moment_arm": {"momentarm", "ma", "arm"},
    "lengthening": {"lengthening"},
}
"""Words of quantities that only muscles have."""

_AMBIGUOUS_MUSCLE_WORDS = frozenset({"ma", "arm"})
"""Words of a moment arm only together with a muscle, because robots have arms, too."""


_MOTOR_AXES = frozenset({"d", "q", "alpha", "beta", "u", "v", "w", "a", "b", "c"})
"""Axes and phases of a motor's currents and voltages: i_q, v_alpha, i_phase_u."""

_MOTOR_LETTERS = {"i": "current", "v": "voltage", "u": "voltage"}
"""Letters of a motor's currents and voltages before an axis."""


_JOINED_MOTOR_NAMES = frozenset({
    "iq", "ialpha", "ibeta", "vd", "vq", "valpha", "vbeta", "ud", "uq", "ualpha", "ubeta",
})  # fmt: skip
"""Letter and axis in one word; "id" is an identifier as well."""


@dataclass(frozen=True)
class NameEvidence:
    """What a column's name says about it."""

    name: str  # name as the file writes it
    bare: str  # name without its unit
    quantity: str | None  # quantity that the words say, None for none
    unit: str | None  # unit that the name states
    is_command: bool  # whether a word says that it was asked for, not measured
    is_interaction: bool  # whether a word says that it acts between robot and person
    muscle: str | None  # muscle, in the words of study.toml
    joint: str | None  # joint of a person that is named
    axis: str | None  # "x", "y", "z" or "w"
    number: int | None  # last number in the name
    is_computed: bool = False  # whether a word says that a program computed it
    is_measured: bool = False  # whether a word says that it was measured
    unknown_unit: str | None = None  # text that is stated as the unit, and is none that is known
    is_machine: bool = False  # whether it is an effort that a word says a machine makes, or has with a person
    scale: float = 1.0  # how many of the unit one stored number is, as stated


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: split at marks, at capitals within a word, and before digits."""
    spaced = re.sub(r"(?<=[a-zà-ÿ0-9])(?=[A-Z][a-z])|(?<=[a-zà-ÿ])(?=[A-Z])", " ", name)
    spaced = re.sub(r"(?<=[A-Za-zà-ÿ])(?=\d)|(?<=\d)(?=[A-Za-zà-ÿ])", " ", spaced)
    return [word for word in re.split(r"[\W_]+", spaced.casefold()) if word]


def read_name(name: str) -> NameEvidence:
    """Return what a column's name says.

    Examples
    --------
    >>> found = read_name("motor_current [mA]")
    >>> found.quantity, found.unit, found.is_command
    ('current', 'mA', False)
    """
    bare, unit = split_unit(name)
    if unit is None and len(name.strip()) > 1 and name.strip() in _UNIT_NAMES:
        unit = unit_from_text(name.strip())
    multiple = ends_in_multiple(name)
    if multiple is not None:
        unit = None
    if unit is not None and _ends_in_muscle(name, bare):
        bare, unit = name, None
    scale = 1.0
    if unit is None and multiple is None and (found := scaled_unit_from_text(stated_unit_text(name) or "")) is not None:
        scale, unit = found
        bare = re.split(r"[\[(]|[_ ]\d+\.\d+ ?\D*$", bare, maxsplit=1)[0].strip() or bare
    # The last part of a dotted path names the quantity: "entries.position".
    _, _, last = bare.rpartition(".")
    own = last if words_of(last) and not words_of(last)[-1].isdigit() and len(last) > 1 else bare
    words = words_of(own)
    if _COMPUTER_WORDS & set(words) or _VALVE_WORDS & set(words):
        words = ["state"]
    joined = re.sub(r"[\W_]+", "", own.casefold())
    commands = COMMAND_WORDS & {*words, joined}
    if INSTRUMENT_WORDS & set(words):
        commands -= {"ref", "reference", "nominal"}
    is_command = bool(commands) or _has_part(words, COMMAND_PARTS, "soll")
    muscle = _muscle(bare)
    quantity = _quantity_of_words(words, joined, has_muscle=muscle is not None)
    is_of_joint = quantity == "position" and QUANTITY_WORDS["position"] & set(words) <= {"flexion", "rotation"}
    if (quantity is None or is_of_joint) and muscle is None and own != bare:
        # "effort.arm_1_joint", "effort.elbow_flexion": the part before names the quantity, the last one the joint.
        quantity = _quantity_of_path(bare.rpartition(".")[0]) or quantity
    if muscle is not None and quantity in (None, "position", "force") and not ({"force", "angle"} & set(words)):
        quantity = "emg"
    if unit is not None and (by_unit := quantity_of_unit(unit)) is not None:
        quantity = _with_quantity_of_unit(quantity, by_unit, unit)
    if name.endswith(".time"):
        # The times of a signal whose own unit stands in its name: "VL: EMG 1 [V].time".
        quantity, unit, muscle = "time", None, None
    numbers = [int(word) for word in words if word.isdigit()]
    return NameEvidence(
        name,
        bare,
        quantity,
        unit,
        is_command,
        bool(INTERACTION_WORDS & set(words)),
        muscle,
        _joint(bare),
        _axis(words, joined),
        numbers[-1] if numbers else None,
        bool(COMPUTED_WORDS & set(words)),
        bool(MEASURED_WORDS & set(words))
        or _has_part(words, MEASURED_PARTS, "ist")
        or (not is_command and bool(INSTRUMENT_WORDS & set(words))),
        multiple or (_unknown_unit(name) if unit is None else None),
        quantity in ("torque", "force") and bool((MACHINE_WORDS | INTERACTION_WORDS) & set(words)),
        scale,
    )


def _has_part(words: Sequence[str], parts: Sequence[str], german: str) -> bool:
    """Whether a word contains one of some parts, or is a German compound with a quantity, as in sollwinkel."""
    if any(part in word for word in words for part in parts):
        return True
    rests = [word.removeprefix(german) for word in words if word.startswith(german)]
    rests += [word.removesuffix(german) for word in words if word.endswith(german)]
    return any(len(rest) >= 4 and rest != "wert" and _is_quantity(rest) for rest in rests) or any(
        f"{german}wert" in word for word in words
    )


def _is_quantity(word: str) -> bool:
    """Whether a word stands for a quantity, or contains such a word."""
    return any(len(known) >= 4 and known in word for each in QUANTITY_WORDS.values() for known in each)


def quantity_of_part(name: str) -> str | None:
    """Return the quantity that a part of a name says in a language that writes several words as one; else None."""
    return next((q for q, parts in QUANTITY_PARTS.items() if any(part in name for part in parts)), None)


def _quantity_of_path(path: str) -> str | None:
    """Return the quantity that the last part of a path which says one says by a word of its own."""
    for part in reversed(path.split(".")):
        words = words_of(part)
        if len(words) <= 2 and (found := _quantity_of_words(words, "".join(words), has_muscle=False)) is not None:
            return found
    return None


def with_stated_unit(evidence: NameEvidence, text: str | None) -> NameEvidence:
    """Return what a name says together with the `text` of the unit that the file states apart from it, if it does.

    A unit in the name itself is the one that counts.
    """
    if text is None or not text.strip() or evidence.unit is not None:
        return evidence
    unit, scale = unit_from_text(text), 1.0
    if unit is None and (found := scaled_unit_from_text(text)) is not None:
        scale, unit = found
    if unit is None:
        return replace(evidence, unknown_unit=_unknown_unit(f"[{text.strip()}]"))
    by_unit = quantity_of_unit(unit)
    quantity = evidence.quantity
    if by_unit is not None:
        quantity = _with_quantity_of_unit(quantity, by_unit, unit)
    return replace(evidence, unit=unit, quantity=quantity, unknown_unit=None, scale=scale)


def _with_quantity_of_unit(quantity: str | None, by_unit: str, unit: str) -> str:
    """Return the quantity that words and a unit say together; the unit decides where they contradict each other."""
    if quantity is not None and _agrees(quantity, by_unit):
        return quantity
    # No drive has microvolts; a bridge of strain gauges may.
    is_muscle = unit in ("uV", "nV") and quantity not in ("torque", "force", "temperature")
    return "emg" if is_muscle else by_unit


def quantity_of_unit(unit: str) -> str | None:
    """Return the quantity that a unit implies for a robot's channel: ``"mA"`` implies a current.

    None if it implies none.
    """
    for quantity, si in (
        ("time", "s"), ("position", "rad"), ("position", "m"), ("velocity", "rad/s"), ("velocity", "m/s"),
        ("acceleration", "rad/s^2"), ("linear_acceleration", "m/s^2"), ("torque", "N*m"), ("force", "N"),
        ("current", "A"), ("voltage", "V"), ("temperature", "K"), ("magnetic_field", "T"), ("stiffness", "N*m/rad"),
        ("damping", "N*m*s/rad"), ("stiffness", "N/m"), ("damping", "N*s/m"), ("emg", "MVC"),
    ):  # fmt: skip
        try:
            to_si_factor(unit, si)
        except ValueError:
            continue
        return quantity
    return None


def _agrees(quantity: str, by_unit: str) -> bool:
    """Whether a unit can be one of the quantity that words say."""
    alike = {
        "emg": {"voltage"}, "supply": {"voltage"}, "angular_velocity": {"velocity"}, "error": {"position"},
        "position": {"position"}, "length": {"position"}, "moment_arm": {"position"}, "duty": set(),
        "acceleration": {"linear_acceleration", "acceleration"}, "lengthening": {"velocity"},
        # A digital line is recorded in volts.
        "state": {"voltage", "time"}, "enabled": {"voltage"}, "counter": {"voltage", "time"},
    }  # fmt: skip
    return by_unit == quantity or by_unit in alike.get(quantity, set())


def _unknown_unit(name: str) -> str | None:
    """Return the text in a name's brackets that is stated as a unit and is none that is known.

    Numbers, phrases, and words that say something else of the column, such as (left) and [raw], are no units.
    """
    text = stated_unit_text(name)
    if text is None or unit_from_text(text) is not None or not re.search(r"[^\W\d_]", text):
        return None
    words = words_of(text)
    if re.search(r"[*/^·⋅²%°µμ]", text):
        return text
    said = {word for known in QUANTITY_WORDS.values() for word in known} | COMMAND_WORDS | COMPUTED_WORDS
    said |= MEASURED_WORDS | INTERACTION_WORDS | set(JOINT_WORDS) | set(HUMAN_JOINT_SUFFIXES) | _REMARK_WORDS
    is_remark = len(words) > 2 or bool(said & set(words)) or _muscle(text) is not None
    return None if is_remark else text


def _quantity_of_words(words: list[str], joined: str, *, has_muscle: bool) -> str | None:
    if (motor := _motor_quantity(words)) is not None and (motor == "current" or {"phase", "ph"} & set(words)):
        return motor
    for first, second in pairwise(words):
        derived = _derived(first, second)
        if derived is not None:
            return derived
    for quantity, known in OTHER_QUANTITY_WORDS.items():
        is_clear = has_muscle or not words or words[0] not in _AMBIGUOUS_MUSCLE_WORDS
        if words and words[0] in known and len(words) > 1 and is_clear:
            return quantity
    if "moment" in words and "arm" in words:
        return "moment_arm"
    for quantity, known in QUANTITY_WORDS.items():
        if joined in known or joined.rstrip("0123456789") in known:
            return quantity
    order = (
        "enabled", "emg", "error", "stiffness", "damping", "torque", "current", "velocity", "temperature", "supply",
            "voltage", "force",
        "linear_acceleration", "angular_velocity", "magnetic_field", "orientation", "acceleration", "duty",
        "position", "time", "counter", "state",
    )  # fmt: skip
    # Words of three letters or more are told from the start of a name to its end; letters alone only if nothing else
    # is.
    told = [word for i, word in enumerate(words) if word != "t" or (i == 0 and not _is_vertebra(words))]
    for long_words in (True, False):
        for quantity in order:
            if any((len(word) >= 3) == long_words and word in QUANTITY_WORDS[quantity] for word in told):
                return quantity
    # A word may stand within another, as in "eposposition", but "extension" names a direction and no tension.
    for direction in _DIRECTIONS_ONLY:
        joined = joined.replace(direction, " ")
    for quantity in order:
        if any(len(word) >= 4 and word in joined for word in QUANTITY_WORDS[quantity]):
            return quantity
    return quantity_of_part(joined)


def _motor_quantity(words: Sequence[str]) -> str | None:
    """Return the quantity that a letter and a motor's axis say, as in i_q, v_alpha, vq or i_phase_u; else None."""
    parts = [word for word in words[:3] if word not in ("phase", "ph")]
    first = parts[0] if parts else ""
    if first in _JOINED_MOTOR_NAMES:
        return _MOTOR_LETTERS[first[0]]
    return _MOTOR_LETTERS.get(first) if len(parts) > 1 and parts[1] in _MOTOR_AXES else None


def motor_voltages(names: Iterable[str]) -> frozenset[str]:
    """Return the columns that hold a motor's voltages, because the same file has currents of its axes.

    Alone, v_d is a desired velocity.

    Examples
    --------
    >>> sorted(motor_voltages(["t", "i_q", "v_q", "q_d"])), sorted(motor_voltages(["t", "v_d", "q_d"]))
    (['v_q'], [])
    """
    found = {name: _motor_quantity(words_of(name.rpartition(".")[2])) for name in names}
    if "current" not in found.values():
        return frozenset()
    return frozenset(name for name, quantity in found.items() if quantity == "voltage")


def _derived(first: str, second: str) -> str | None:
    """Return the derivative that two words say, as theta_dot, q_ddot and d_theta do; None if they say none."""
    if second in ("dot", "ddot"):
        if first in QUANTITY_WORDS["position"]:
            return "velocity" if second == "dot" else "acceleration"
        return "acceleration" if second == "dot" and first in QUANTITY_WORDS["velocity"] else None
    if first in ("d", "dd") and second in ("theta", "q", "phi", "angle", "position"):
        return "velocity" if first == "d" else "acceleration"
    return None


def _is_vertebra(words: Sequence[str]) -> bool:
    """Whether a name begins with a thoracic vertebra, as T12_L1 does, and not with the letter of time."""
    return len(words) > 2 and words[1].isdigit()


def _muscle(bare: str) -> str | None:
    found = find_muscle(words_of(bare))
    return None if found is None else found.name


def _ends_in_muscle(name: str, bare: str) -> bool:
    """Whether the last word of a label of EMG is a muscle's and no unit: the left biceps femoris of "EMG LBF"."""
    words = words_of(name)
    is_label = name[-1:].isalpha() and bool({"emg", "semg"} & set(words))
    return is_label and _muscle(bare) is None and _muscle(name) is not None


def emg_muscle(name: str) -> str | None:
    """Return the muscle that a column names which holds EMG; None if it names none."""
    found = emg_muscle_label(name)
    return None if found is None else found.name


def emg_muscle_label(name: str) -> MuscleLabel | None:
    """Return the muscle that a column names which holds EMG, with its confidence; None if it names none."""
    return find_muscle(words_of(read_name(name).bare), is_emg=True)


def is_emg_by_unit(name: str, unit: str | None, emg_units: Sequence[str | None]) -> bool:
    """Whether a column named after a muscle is EMG, because two or more columns are EMG and one of them has its unit.

    `emg_units` are the units of the columns that are EMG, None if unstated.
    """
    return unit is not None and len(emg_units) > 1 and unit in emg_units and emg_muscle(name) is not None


def _joint(bare: str) -> str | None:
    folded = bare.casefold()
    return next((joint for joint in JOINT_WORDS if joint in folded), None)


_NAMED_AXIS = re.compile(r"(a|g|m|acc|gyr|gyro|mag|q|quat|accel)[xyzw]")
"""A letter or a word of an inertial quantity with its axis, as in imu_ax."""

_UNIT_NAMES = frozenset({"Nm", "N*m", "N·m", "N.m", "mNm", "Ncm", "deg", "rad", "rpm", "mA", "deg/s", "rad/s"})
"""Units that a column may have for a name."""

_VALVE_WORDS = frozenset({"valve", "valves", "solenoid", "regulator", "heater", "pressure", "druck", "pression",
                          "presión", "presion", "pressione"})  # fmt: skip
"""Words of devices other than a joint's motor that a voltage or a current may drive, and of pressures."""

_COMPUTER_WORDS = frozenset({"cpu", "gpu", "ram", "memory", "disk", "network", "thread"})
"""Words of a computer, whose load is no force."""


def _axis(words: list[str], joined: str) -> str | None:
    if words and words[-1] in ("x", "y", "z", "w"):
        return words[-1]
    named = next((text for text in (joined, *words[-1:]) if _NAMED_AXIS.fullmatch(text)), "")
    return named[-1:] or None
