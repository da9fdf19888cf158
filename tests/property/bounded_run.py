"""Read every small file of `slow_inputs`, and print the processor time and memory that each took: a program of its own.

The limits on its memory and time hold for all of them together, so that a parser that swells ends it.
"""

import json
import resource
import sys
import tempfile
from pathlib import Path
from time import process_time

import slow_inputs

from pellucid._errors import PellucidError
from pellucid.arm.urdf import read_urdf
from pellucid.files.log import inspect_log, log_of
from pellucid.files.readers.read import read_columns
from pellucid.models.card import read_table
from pellucid.start.given_files import read_given
from pellucid.study.study_file import parse_study_file
from pellucid_lab.known_rigs import load_rig

MEMORY_BYTES = 1_500_000_000
"""Address space that all files together may take beyond what the program has after its imports."""

CPU_SECONDS = 400
"""Processor time that all files together may take."""


def read_recording(path):
    """Read, inspect and group a recording, as `audit` and `init` do."""
    inspect_log(log_of(read_columns(path)))
    read_given([path])


READERS = (
    ("recording", slow_inputs.RECORDINGS, read_recording, None),
    ("study", slow_inputs.STUDIES, parse_study_file, "study.toml"),
    ("rig", slow_inputs.STUDIES, load_rig, "rig.toml"),
    ("robot", slow_inputs.ROBOTS, read_urdf, "robot.urdf"),
    ("card", slow_inputs.CARDS, read_table, "card.json"),
)


def main(size):
    """Read the files, each of about a size [B]."""
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY_BYTES,) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS,) * 2)
    folder = Path(tempfile.mkdtemp())
    for kind, skeletons, read, file_name in READERS:
        for name, skeleton in skeletons.items():
            path = folder / (file_name or name)
            for filler in slow_inputs.FILLERS:
                path.write_bytes(slow_inputs.filled(skeleton, filler, size))
                before, said, broken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, "", ""
                began = process_time()
                try:
                    read(path)
                except PellucidError as error:
                    said = str(error)
                except Exception as error:
                    broken = repr(error)[:200]
                seconds = process_time() - began
                grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
                print(json.dumps([f"{kind} {name} {filler!r}", seconds, grown / 1e3, len(said), broken]), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))
