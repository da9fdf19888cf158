"""Tell from columns' names to which joint of a robot each belongs: by the words in which columns of one kind differ."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...files.name_evidence import COMMAND_WORDS, COMPUTED_WORDS, MEASURED_WORDS, QUANTITY_WORDS, words_of
from ...files.stated_units import split_unit

MOTOR_WORDS = frozenset({"motor", "rotor", "mot", "moteur", "motore"})
"""Words of what is measured before a gear. An actuator may contain one."""

MOTOR_PARTS = ("电机", "電機", "马达", "馬達", "モータ", "모터", "двигател")
"""Parts of such names in languages that write several words as one."""

SIDE_WORDS = {
    "motor": MOTOR_WORDS | {"drive", "actuator", "input", "elec", "electrical"},
    "output": frozenset({
        "output", "joint", "link", "load", "out", "mech", "mechanical", "shaft", "absolute", "abs", "gelenk", "abtrieb",
        "articulation", "articulación", "articulacion", "articulação", "giunto", "junta", "gewricht",
    }),
}  # fmt: skip
"""Words of names that tell the side of a gear."""

SIDE_PARTS = {
    "motor": (*MOTOR_PARTS, "motorwinkel", "motorposition", "motordrehzahl", "motormoment", "motorstrom"),
    "output": ("关节", "關節", "関節", "负载", "負載", "負荷", "输出轴", "出力軸", "관절", "сустав", "gelenkwinkel",
        "gelenkposition", "gelenkmoment"),
}  # fmt: skip
"""Parts of names that tell the side of a gear in languages that write several words as one."""

_PLAIN_WORDS = (
    frozenset(word for words in QUANTITY_WORDS.values() for word in words)
    | COMMAND_WORDS
    | COMPUTED_WORDS
    | MEASURED_WORDS
    | SIDE_WORDS["motor"]
    | SIDE_WORDS["output"]
    | frozenset({
        "states", "state", "joint", "joints", "topic", "data", "field", "fields", "value", "values", "signal",
        "channel", "feedback", "raw", "filtered", "filt", "est", "estimate", "estimated", "encoder", "control",
        "controller", "axes", "axis", "msg", "msgs", "header", "current", "actual", "average", "mean", "d", "j", "h",
        "abs", "ext", "hat", "of", "in", "the", "to", "my",
    })
)  # fmt: skip
"""Words that name no joint."""


@dataclass(frozen=True)
class JointKey:
    """What a column's name says of its joint."""

    words: tuple[str, ...]  # words that may name a joint, folded
    text: str  # the joint's name as the file writes it, "" if only a number tells it


def side_of(name: str) -> str | None:
    """Return the side of a gear that a name tells, ``"motor"`` or ``"output"``; None if it tells none or both."""
    bare = split_unit(name)[0]
    words, folded = set(words_of(bare)), bare.casefold()
    found = [
        side for side, known in SIDE_WORDS.items() if words & known or any(part in folded for part in SIDE_PARTS[side])
    ]
    return found[0] if len(found) == 1 else None


def is_named_motor(name: str) -> bool:
    """Whether a name says that something was measured at a motor, before its gear."""
    return bool(MOTOR_WORDS & set(words_of(name))) or any(part in name.casefold() for part in MOTOR_PARTS)


def joint_keys(names: Sequence[str]) -> dict[str, JointKey]:
    """Return what tells the joint of each of several columns of one quantity; empty if nothing tells them apart.

    Words of quantities, commands and sides name no joint, nor do words that all columns share.

    Examples
    --------
    >>> {name: key.text for name, key in joint_keys(["position.arm_1_joint", "position.wrist"]).items()}
    {'position.arm_1_joint': 'arm_1_joint', 'position.wrist': 'wrist'}
    """
    words = {name: _own_words(name) for name in names}
    shared = set.intersection(*(set(own) for own in words.values())) if words else set()
    own = {name: tuple(word for word in each if word not in shared) for name, each in words.items()}
    # "a1" and "a2" share the letter, which belongs to the number.
    if len(set(own.values())) < len(names) or any(not each for each in own.values()):
        return {}
    return {name: JointKey(own[name], _text(name, own[name], shared)) for name in names}


def _own_words(name: str) -> list[str]:
    return [word for word in words_of(split_unit(name)[0]) if word not in _PLAIN_WORDS]


def _text(name: str, own: Sequence[str], shared: set[str]) -> str:
    """Return the joint's name as the file writes it."""
    if all(word.isdigit() for word in own):
        beside = [word for word in _own_words(name) if word in shared and not word.isdigit()]
        if not beside:
            return ""
    # A part of a path that is a name by itself is the joint's.
    for part in re.split(r"[./#\s\[\]()]+", split_unit(name)[0]):
        words = words_of(part)
        inner = [word for word in words if word not in _PLAIN_WORDS]
        is_own = bool(words) and set(own) <= set(words) and not words[0].isdigit()
        quantities = [w for w in words if any(w in known for known in QUANTITY_WORDS.values()) and len(w) > 1]
        if is_own and inner and not quantities and not set(words) & (COMMAND_WORDS | MEASURED_WORDS):
            return re.sub(r"[^A-Za-z0-9_-]+", "_", part).strip("_-") or ""
    text = ""
    for word in (w for w in _own_words(name) if w in own or (w in shared and not w.isdigit())):
        text += word if not text or (word.isdigit() and not text[-1].isdigit()) else f"_{word}"
    return "" if text.isdigit() else text


def matching_joint(name: str, keys: Mapping[str, JointKey]) -> str | None:
    """Return the joint, one of `keys`, whose words a column's name holds; None if none or several do."""
    own = words_of(split_unit(name)[0])
    fitting = [joint for joint, key in keys.items() if _holds(own, key.words)]
    longest = max((len(keys[joint].words) for joint in fitting), default=0)
    best = [joint for joint in fitting if len(keys[joint].words) == longest]
    return best[0] if len(best) == 1 else None


def _holds(own: Sequence[str], words: Sequence[str]) -> bool:
    left = list(own)
    for word in words:
        if word not in left:
            return False
        left.remove(word)
    return True
