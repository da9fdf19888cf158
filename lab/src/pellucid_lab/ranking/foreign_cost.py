"""What a foreign law in C costs on a Cortex-M4F: compiled for it, run in QEMU, its instructions counted.

The law is written in double precision, which this processor's floating-point unit does not have: the count is that of
the law as it is, with the compiler's library for doubles.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from pathlib import Path

from pellucid.controllers.export.c_folder import template_folder
from pellucid.controllers.export.microcontroller import missing_tools

from .foreign_law import COMPILER_FLAGS, ForeignLaw
from .foreign_worker import C_FUNCTIONS, JOINT_COUNTS

COUNTED_STEPS = 500
"""Number of steps whose instructions are counted."""

SAMPLE_PERIOD_S = 0.002
"""Time between two samples of the motion with which a law is counted [s]."""

MAX_COUNT_S = 60.0
"""Longest time for compiling, and for counting [s]."""

TARGET_FLAGS = (
    "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-ffunction-sections", "-fdata-sections",
)  # fmt: skip
"""Flags for a Cortex-M4F."""

LINKER_FLAGS = ("-nostartfiles", "-Wl,--gc-sections", "-Wl,--no-warn-rwx-segments", "-lm", "-lc", "-lgcc")
"""Flags for a program without an operating system."""

BOARD_COMMAND = (
    "qemu-system-arm", "-machine", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none",
    "-chardev", "stdio,id=said", "-semihosting-config", "enable=on,target=native,chardev=said", "-icount", "shift=0",
)  # fmt: skip
"""Command that runs a program on the emulated board, one instruction a nanosecond."""

TEMPLATES = template_folder()
"""Folder with what a Cortex-M4F needs before its main function."""

COUNTER_PROGRAM = """
#include <stdint.h>
#include "say.h"
#define SYSTICK ((volatile uint32_t*)0xE000E010u)
ASKED
void law_reset(void);
static const double samples[STEPS][3] = {SAMPLES};
static volatile double sum;
static uint32_t ticks(double (*volatile step)(double, double, double)) {
  const uint32_t start = SYSTICK[2];
  for (int i = 0; i < STEPS; ++i) sum = step(samples[i][0], samples[i][1], samples[i][2]);
  return (start - SYSTICK[2]) & 0xffffffu;
}
int main(void) {
  SYSTICK[1] = 0xffffffu;
  SYSTICK[2] = 0;
  SYSTICK[0] = 5;
  law_reset();
  const uint32_t with = ticks(ASK), without = ticks(nothing);
  say("instructions", with > without ? 40u * (with - without) : 0u);
  return 0;
}
"""
"""Program that counts; SysTick counts every 40 instructions."""


ASKED_ONE = """
double FUNCTION(double time, double position, double torque);
#define ASK FUNCTION
__attribute__((noinline)) static double nothing(double time, double position, double torque) {
  __asm volatile("" ::: "memory");
  (void)position, (void)torque;
  return time;
}
"""
"""How a law of one joint is called, and a function that does nothing."""

ASKED_SEVERAL = """
void FUNCTION(double time, const double position[], const double torque[], double effort[]);
static double at[JOINTS], felt[JOINTS], effort[JOINTS];
__attribute__((noinline)) static double nothing(double time, double position, double torque) {
  for (int k = 0; k < JOINTS; ++k) at[k] = position, felt[k] = torque;
  __asm volatile("" ::: "memory");
  return time;
}
__attribute__((noinline)) static double ask(double time, double position, double torque) {
  for (int k = 0; k < JOINTS; ++k) at[k] = position, felt[k] = torque;
  __asm volatile("" ::: "memory");
  FUNCTION(time, at, felt, effort);
  return time;
}
#define ASK ask
"""
"""How a law of several joints is called, and a function that does all else."""


def count_instructions(law: ForeignLaw, robot: str) -> float | None:
    """Return the mean number of instructions of one step of a law in C on a Cortex-M4F.

    Parameters
    ----------
    law : ForeignLaw
    robot : str
        ``"knee"``, ``"elbow"`` or ``"arm"``: whose function of the law is counted.

    Returns
    -------
    float or None
        None for a law that is no C file, that cannot be compiled or linked for this processor, or that does not end
        there, and where a compiler or QEMU is not installed.
    """
    if law.path.suffix != ".c" or missing_tools():
        return None
    folder = Path(tempfile.mkdtemp(prefix="pellucid-cost-"))
    try:
        for name in ("m4.c", "m4.ld", "say.h"):
            shutil.copy(TEMPLATES / f"{name}.j2", folder / name)
        rows = ",".join(f"{{{time!r},{position!r},{torque!r}}}" for time, position, torque in _samples())
        joints = JOINT_COUNTS[robot]
        asked = (ASKED_SEVERAL if joints > 1 else ASKED_ONE).replace("JOINTS", str(joints))
        text = COUNTER_PROGRAM.replace("ASKED", asked).replace("FUNCTION", C_FUNCTIONS[robot]).replace("SAMPLES", rows)
        (folder / "count.c").write_text(text.replace("STEPS", str(COUNTED_STEPS)), encoding="utf-8")
        exact = [flag for flag in COMPILER_FLAGS if flag not in ("-fPIC", "-shared", "-lm")]
        sources = [str(law.path), "count.c", "m4.c"]
        words = ["arm-none-eabi-gcc", *exact, *TARGET_FLAGS, *sources, "-T", "m4.ld", *LINKER_FLAGS, "-o", "count.elf"]
        subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=MAX_COUNT_S)
        run = subprocess.run(
            [*BOARD_COMMAND, "-kernel", "count.elf"], cwd=folder, check=True, capture_output=True, text=True,
            timeout=MAX_COUNT_S, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        return int(run.stdout.split()[1]) / COUNTED_STEPS
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired, OSError, ValueError, IndexError):
        return None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _samples() -> list[tuple[float, float, float]]:
    """Return times [s], positions [rad] and torques [N m] of a swing of 1 Hz."""
    phases = [2.0 * math.pi * SAMPLE_PERIOD_S * i for i in range(COUNTED_STEPS)]
    return [
        (SAMPLE_PERIOD_S * i, 0.8 + 0.6 * math.sin(phase), 2.0 * math.cos(1.7 * phase))
        for i, phase in enumerate(phases)
    ]
