"""Consistency of answers: each generated result must give one answer in all its outputs.

Joints are simulated by a separate equation of motion, with effects that the fitted models lack, and written as files.
Movements in pointing studies are random. Compared outputs are terminal, notebook, results.json, JSON, rows, findings,
intervals and, for some, the page.
"""

from __future__ import annotations

import html
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellucid.people.study.assessment_result import AssessmentResult
from pellucid.study.answer import MAX_NAMED_ASSUMPTIONS, Answer
from pellucid.study.pages.values import plain_text
from pellucid.study.procedures.print_result import print_to_text
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.result import Result
from pellucid.study.procedures.run import report, run
from pellucid.study.results import read_answers, read_rows

RATE_HZ = 200.0
"""Sampling rate of the simulated joints."""

DURATION_S = 8.0
"""Duration of a simulated recording."""

STUDY_HEAD = """name = "joint{seed}"
simulated = true
{assumed}[rig]
motion = "rotary"
[rig.drive]
kind = "torque"
[model]
families = ["symmetric"]
[channels]
time = {{ column = "t", unit = "s" }}
position = {{ column = "q", unit = "rad" }}
torque = {{ column = "tau", unit = "N*m" }}
[processing]
lowpass = "15 Hz"
decimate = 4
"""

ASSUMED = '[[assumed]]\nkey = "{key}"\ntaken = "{taken}"\nquestion = "Which one?"\nscale = {scale}\n'

RECORDING = '[[recordings]]\nname = "{name}"\nfile = "{name}.csv"\nuse = "{use}"\n'


@dataclass(frozen=True)
class Compared:
    """What was found of the answers of one result."""

    name: str
    answer: Answer
    contradictions: tuple[str, ...]


def write_joint(folder: Path, seed: int) -> Path:
    """Write the recordings and the study.toml of a simulated joint, and return its folder.

    Seeds draw the joint, what its model lacks, noise, which recordings are held out, which is cut, and which default
    nobody confirmed.
    """
    rng = np.random.default_rng([501, seed])
    folder.mkdir(parents=True)
    count = int(rng.integers(1, 5))
    uses = ["fit", *rng.choice(["fit", "validate"], count - 1).tolist()]
    inertia, weight, coulomb, viscous = (float(rng.uniform(*ends)) for ends in ((0.03, 0.3), (0.5, 4.0), (0.1, 0.8),
                                                                              (0.05, 0.4)))  # fmt: skip
    lack = float(rng.choice([0.0, 0.05, 0.3, 1.0]))  # size of the effects that the fitted model lacks
    is_garbage, cut = rng.random() < 0.06, int(rng.integers(0, count)) if rng.random() < 0.2 else -1
    t = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    for i in range(count):
        phases, rates = rng.uniform(0.0, 2.0 * np.pi, 4), rng.uniform(0.2, 2.0, 4)
        sizes = rng.uniform(0.1, 0.4, 4)
        waves = [size * np.sin(2.0 * np.pi * rate * t + phase) for size, rate, phase in zip(sizes, rates, phases,
                                                                                            strict=True)]  # fmt: skip
        q = sum(waves)
        v = np.gradient(q, t)
        a = np.gradient(v, t)
        tau = inertia * a + weight * np.sin(q) + coulomb * np.tanh(v / 0.02) + viscous * v
        tau += lack * (0.6 * weight * np.sin(7.0 * q + 1.0) + 0.5 * coulomb * v * np.abs(v) + 0.3 * weight * q**3)
        tau += 0.02 * np.std(tau) * rng.standard_normal(len(t))
        if is_garbage:
            tau = rng.standard_normal(len(t))
        rows = np.column_stack([t, q + 2e-4 * rng.standard_normal(len(t)), tau])
        if i == cut:
            rows = np.delete(rows, slice(len(t) // 3, len(t) // 3 + int(RATE_HZ)), axis=0)
        np.savetxt(folder / f"r{i}.csv", rows, delimiter=",", header="t,q,tau", comments="", fmt="%.7g")
    assumed = ""
    if rng.random() < 0.3:
        scale = rng.random() < 0.5
        key, taken = ("position_unit", "rad") if scale else ("worn", "no")
        assumed = ASSUMED.format(key=key, taken=taken, scale=str(bool(scale)).lower())
    text = STUDY_HEAD.format(seed=seed, assumed=assumed)
    text += "".join(RECORDING.format(name=f"r{i}", use=use) for i, use in enumerate(uses))
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def compared_joint(folder: Path, seed: int, *, with_page: bool = False) -> Compared | None:
    """Return what the parts of one simulated joint's result say; None if `check` refuses its recordings."""
    from pellucid._errors import PellucidError

    study = open_study(write_joint(folder / f"joint{seed}", seed))
    try:
        result = run(study, "identify", joint={"thorough": False})
    except PellucidError:
        return None
    result.save(study)
    found = list(contradictions(result))
    found += _stored(result, read_answers(study.results_path), {r.id for r in read_rows(study.results_path)})
    if with_page:
        found += page_contradictions(result, report(study, result).read_text(encoding="utf-8"))
    return Compared(study.name, result.answer, tuple(found))


def contradictions(result: Result) -> Iterator[str]:
    """Yield what terminal, notebook, rows, findings, parts and numbers of a result say against its answer."""
    printed, notebook = _joined(print_to_text(result)), _joined(html.unescape(result._repr_html_()))
    for part in result.each:
        answer = part.answer
        opening = f"{answer.badge}. {answer.sentence[:60]}"
        for where, text in (("terminal", printed), ("notebook", notebook)):
            if _bare(answer.question) not in _bare(text) or _bare(opening) not in _bare(text):
                yield f"the {where} does not show the answer"
            if answer.basis is not None and answer.basis.used != answer.basis.recorded:
                told = f"{answer.basis.used} of {answer.basis.recorded}"
                if told not in text:
                    yield f"the {where} does not say {told}"
            for each in answer.assumed[:MAX_NAMED_ASSUMPTIONS]:
                if each.words not in text:
                    yield f"the {where} does not say that {each.words} is assumed"
        yield from _answer_alone(answer)
        yield from _against_rows(part, answer)
        yield from _against_findings(part, answer)
        if isinstance(part, AssessmentResult):
            yield from _against_tests(part, answer)


def _answer_alone(answer: Answer) -> Iterator[str]:
    """Yield what an answer says against itself."""
    if answer.verdict == "yes" and answer.reason:
        yield "the answer yes has a reason against it"
    if answer.verdict != "yes" and not answer.reason:
        yield f"the answer {answer.verdict} has no reason"
    if not answer.next:
        yield "there is no next step"
    is_told = answer.is_relative and "scale not confirmed" in answer.badge
    if any(each.is_scale for each in answer.assumed) and answer.is_answered and not is_told:
        yield "a default scales every number, but the question is answered without a word of it"
    if answer.basis is not None and not 0 <= answer.basis.used <= answer.basis.recorded:
        yield f"{answer.basis.used} of {answer.basis.recorded} were used"
    bounds = re.search(r"within ([\d.]+) %\?$", answer.question)
    errors = [n for n in answer.numbers if n.unit == "%" and n.what.startswith("error of")]
    if bounds and len(errors) == 1 and answer.is_answered:
        good = errors[0].value <= float(bounds[1])
        if answer.verdict == "yes" and not good:
            yield f"yes, and the error is {errors[0].value:.3g} %"
        r2 = next((n.value for n in answer.numbers if n.what.startswith("R2")), 1.0)
        if answer.verdict == "no" and good and r2 >= 0.8:
            yield f"no, and the error is {errors[0].value:.3g} %, R2 {r2:.3g}"


def _against_rows(result: Result, answer: Answer) -> Iterator[str]:
    """Yield numbers of an answer that differ from their rows, or that are of data that were fitted."""
    rows = {row.id: row for row in result.rows}
    for number in (n for n in answer.numbers if n.id):
        row = rows.get(number.id)
        if row is None or row.value is None:
            yield f"{number.id} has no row"
        elif not np.isclose(row.value, number.value, rtol=1e-9):
            yield f"{number.id} is {number.value} in the answer and {row.value} in its row"
        elif row.split == "fitted" and answer.is_answered and not isinstance(result, AssessmentResult):
            yield f"{number.id} is of what was fitted"


def _against_findings(result: Result, answer: Answer) -> Iterator[str]:
    """Yield contradictions between the answer and the findings, such as yes with a finding that the figures are
    wrong.
    """
    if result.flaw and answer.is_answered:
        yield f"{answer.verdict}, and a finding says: {result.flaw[:80]}"
    if answer.verdict == "no" and any(v.finding == "prediction" and v.kind == "good" for v in result.verdicts):
        yield "no, and a finding calls the prediction good"


def _against_tests(found: AssessmentResult, answer: Answer) -> Iterator[str]:
    """Yield what tests and intervals of a study of people say against its answer."""
    alpha = 1.0 - found.confidence
    for each in found.certified:
        own = each.certificate
        if f"{each.condition}: {own.verdict}" not in answer.sentence:
            yield f"{each.condition} is not named"
        for name, point in own.end_points.items():
            low, high = point.interval
            beyond = low >= point.margin.high or high <= point.margin.low
            if beyond and own.said_of(name) == "within":
                yield f"{name} lies beyond its margin by its interval, and is said to lie within"
            if own.verdict == "transparent" and not (point.margin.low <= low <= high <= point.margin.high):
                yield f"{each.condition} is transparent, and the interval of {name} leaves its margin"
    if not found.certified:
        for assessed in found.assessed.values():
            for condition in assessed.comparison.pairwise:
                if assessed.differs(condition, found.control, alpha) and condition not in answer.sentence:
                    yield f"{condition} differs in {assessed.name} and is not named"


def _stored(result: Result, told: list[dict], rows: set[str]) -> Iterator[str]:
    """Yield answers of results.json that are not the result's."""
    wanted = [json.loads(json.dumps(part.answer.table())) for part in result.each]
    if [{k: v for k, v in one.items() if k not in ("command", "procedure")} for one in told] != wanted:
        yield "results.json holds another answer"
    missing = {n.id for part in result.each for n in part.answer.numbers if n.id} - rows
    if missing:
        yield f"results.json lacks {', '.join(sorted(missing))}"


def page_contradictions(result: Result, page: str) -> Iterator[str]:
    """Yield what the page of a result says against its answer."""
    answer = result.each[0].answer
    badge = re.search(r'class="badge">([^<]+)<', page)
    if badge is None or badge[1] != answer.badge:
        yield f"the page's badge is {badge and badge[1]}, the answer {answer.badge}"
    lead = re.search(r'class="lead">(.*?)</p>', page, re.DOTALL)
    shown = _bare(re.sub(r"<[^>]+>", "", html.unescape(lead[1]))) if lead else ""
    if _bare(f"{answer.badge} {plain_text(answer.said)[:60]}") not in shown:
        yield f"the page's sentence is another one: {shown[:80]}"
    text = _bare(html.unescape(re.sub(r"<[^>]+>", "", page)))
    for step in answer.next:
        if step.command and step.name != "report" and _bare(step.command) not in text:
            yield f"the page does not say {step.command}"
    if answer.basis is not None and _bare(answer.basis.sentence) not in text:
        yield "the page does not say what the answer is based on"


def _joined(text: str) -> str:
    return " ".join(re.sub(r"<[^>]+>", " ", text).split())


def _bare(text: str) -> str:
    """Return letters and digits alone, in small letters: typography and line breaks say nothing."""
    return re.sub(r"[^0-9a-z]", "", text.lower().replace("²", "2"))


def failing_next_commands(folders: list[Path]) -> list[str]:
    """Run `identify` on studies by its command, then the first command that its answer names; return what fails.

    The status of `identify` is 0 where its question was answered, and 1 where it was not.
    """
    failing = []
    for folder in folders:
        done = _pellucid("identify", str(folder))
        told = read_answers(folder / "results.json")[0]
        if done.returncode != (1 if told["verdict"] == "cannot say" else 0):
            failing.append(f"identify {folder.name}: {told['verdict']}, status {done.returncode}")
        for step in told["next"]:
            words = step["command"].split()
            if words and words[1] in ("check", "report") and _pellucid(*words[1:]).returncode:
                failing.append(step["command"])
    return failing


def _pellucid(*words: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "pellucid", *words], capture_output=True, text=True)


def compare_answers(count: int, pages: int, commands: int) -> tuple[list[Compared], list[str]]:
    """Return what `count` generated results say, the first of them with their `pages`, and commands that fail."""
    found: list[Compared] = []
    with tempfile.TemporaryDirectory() as folder:
        place, seed = Path(folder), 0
        while len(found) < count:
            compared = compared_joint(place, seed, with_page=len(found) < pages)
            found += [compared] if compared is not None else []
            seed += 1
        studies = [place / one.name for one in found[:commands]]
        failing = failing_next_commands(studies)
    return found, failing
