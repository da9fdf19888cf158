"""What happens in the studies of the challenge: one entry for each scenario, all effects in sizes of the margin."""

from __future__ import annotations

from dataclasses import dataclass

MARGIN = 0.10
"""Largest change of the time to rest that does not matter, as a share of control."""


@dataclass(frozen=True)
class Scenario:
    """What a robot, a design and a laboratory do. Effects are on logarithms of times, in sizes of the margin."""

    name: str
    change: float = 0.0  # mean over people of the robot's effect
    spread: float = 1.0 / 3.0  # standard deviation of people's effects
    people_shape: str = "any"  # "normal", "skewed", "heavy", "flat", "subgroup", or "any" of the first four
    design: str = "parallel"  # "parallel": interleaved trials; "crossover", "lopsided", "williams": ordered sessions
    period: float = 0.0  # largest effect of one session more, of either sign
    carry_over: float = 0.0  # what a session with the robot leaves for the next one, in the direction that hides
    lost: float = 0.0  # share of the movements with the robot that are lost: the longest ones
    lost_at_random: float = 0.0  # share of all movements that are lost whatever their length
    far_only: bool = False  # whether the robot slows only the longer amplitudes, and these alone are lost
    growth: float = 0.0  # by how much the effect at the end of a session exceeds its mean
    practice: float = 0.0  # by how much everybody becomes faster in a session, with and without the robot
    corrected: tuple[float, float] = (0.15, 0.15)  # share of movements with a correction: control, robot
    backwards: bool = False  # whether corrections follow an overshoot
    noise: float = 1.0  # factor on the sensor's noise


SCENARIOS = (
    Scenario("no change"),
    Scenario("a third of the margin", change=1.0 / 3.0),
    Scenario("at the margin", change=1.0),
    Scenario("beyond the margin", change=1.5),
    Scenario("no change, people differ by half the margin", spread=0.5),
    Scenario("period, no change", design="crossover", period=2.0),
    Scenario("period, at the margin", change=1.0, design="crossover", period=2.0),
    Scenario("lopsided orders, at the margin", change=1.0, design="lopsided", period=2.0),
    Scenario("lopsided orders, no change", design="lopsided", period=2.0),
    Scenario("carry-over, at the margin", change=1.0, design="crossover", carry_over=0.25),
    Scenario("carry-over, no change", design="crossover", carry_over=0.25),
    Scenario("long movements are lost, at the margin", change=1.0, lost=0.3),
    Scenario("a few movements are lost at random, no change", lost_at_random=0.04),
    Scenario("the change grows", change=0.5, growth=1.0),
    Scenario("practice in both conditions, no change", practice=1.0),
    Scenario("only far targets are slowed, at the margin", change=1.0, far_only=True),
    Scenario("far targets are slowed and lost, at the margin", change=1.0, far_only=True, lost=0.25),
    Scenario("corrections backwards with the robot", corrected=(0.05, 0.85), backwards=True),
    Scenario("corrections backwards in both conditions, no change", corrected=(0.3, 0.3), backwards=True),
    Scenario("a third of the people are slowed", change=0.4, spread=1.0, people_shape="subgroup"),
    Scenario("people differ by more than the margin", spread=1.2),
    Scenario("two robots, no change", design="williams", period=1.0),
    Scenario("two robots, at the margin", change=1.0, design="williams", period=1.0),
    Scenario("a few are slowed much, at the margin", change=1.0, people_shape="skewed"),
    Scenario("noisy sensor, no change", noise=4.0),
)
"""Every scenario of the challenge."""
