"""Write the studies of the challenge into a folder: ``python -m research.certificate DIR [--truths FILE]``.

Truths are written only where they are asked for, into a file apart from the studies.
"""

import argparse
import json
from pathlib import Path

from .generator import STUDY_COUNT, name_of, truth_of, write_study


def main() -> None:
    parser = argparse.ArgumentParser("python -m research.certificate", description="Write studies with known truth.")
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder to write to, one folder for each study")
    parser.add_argument("--studies", type=int, default=STUDY_COUNT, help="number of studies (default: %(default)s)")
    parser.add_argument("--truths", type=Path, metavar="FILE", help="file for the truths")
    told = parser.parse_args()
    for i in range(told.studies):
        place = told.folder / name_of(i)
        place.mkdir(parents=True, exist_ok=True)
        write_study(i, place)
    if told.truths:
        truths = [vars(truth_of(i)) for i in range(told.studies)]
        told.truths.write_text(json.dumps(truths, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
