"""How many parameters a robot has whose joints have one set for each combination of directions of motion."""

from __future__ import annotations

from itertools import product

from pellucid._errors import PellucidError


def chain_parameters(joints: int, per_joint: int) -> int:
    """With joint i coupled to the directions of the joints on one side of it only: p (2^n - 1), the paper's eq. 7."""
    _check(joints, per_joint)
    return per_joint * (2**joints - 1)


def coupled_parameters(joints: int, per_joint: int) -> int:
    """With every joint coupled to the directions of all others: n p 2^(n-1)."""
    _check(joints, per_joint)
    return joints * per_joint * 2 ** (joints - 1)


def listed_sets(coupled_to: list[set[int]]) -> int:
    """Sets of parameters by listing them: for each joint, every combination of the others' directions it depends on."""
    return sum(len(set(product((-1, 1), repeat=len(others)))) for others in coupled_to)


def _check(joints: int, per_joint: int) -> None:
    if joints < 1 or per_joint < 1:
        raise PellucidError(f"{joints} joints of {per_joint} parameters; both must be at least 1")
