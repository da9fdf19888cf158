"""Text that Spike2 exports: a block of lines for each channel, with title, unit, start and interval above values."""

from __future__ import annotations

import re
from itertools import zip_longest

CHANNEL_LINE = '"CHANNEL"'
"""Beginning of the line with which the block of a channel begins."""

_START = re.compile(r'"START"[\t ,]+([-+\d.eE]+)[\t ,]+([-+\d.eE]+)\s*')
_TEXT = re.compile(r'"([^"]*)"\s*')


def waveform_table(content: bytes) -> bytes | None:
    """Return the waveforms of a text of Spike2 as a table with a column of times before each; None of any other text.

    >>> block = '"CHANNEL"\\t"1"\\n"Waveform"\\n"a comment"\\n"VL"\\n"mV"\\n\\n"START"\\t0.5\\t0.001\\n1.5\\n2.5\\n'
    >>> waveform_table(block.encode()).splitlines()
    [b'X [s]\\tVL [mV]', b'0.5\\t1.5', b'0.501\\t2.5']
    """
    if CHANNEL_LINE.encode() not in content or b'"START"' not in content:
        return None
    lines = content.decode("utf-8", errors="replace").splitlines()
    begins = [i for i, line in enumerate(lines) if line.startswith(CHANNEL_LINE)]
    heads: list[str] = []
    columns: list[list[str]] = []
    for first, last in zip(begins, [*begins[1:], len(lines)], strict=True):
        at, match = next(
            ((i, match) for i in range(first, last) if (match := _START.fullmatch(lines[i])) is not None), (last, None)
        )
        if match is None:
            continue
        # Above the values stand the kind, a comment, the title and the unit.
        texts = [found[1] for line in lines[first + 1 : at] if (found := _TEXT.fullmatch(line))]
        title, unit = [*texts[2:4], "", ""][:2]
        values = [line.strip() for line in lines[at + 1 : last] if line.strip()]
        start, step = float(match[1]), float(match[2])
        heads += ["X [s]", f"{title or f'channel {len(columns) // 2 + 1}'} [{unit}]" if unit else title]
        columns += [[f"{start + step * i:.10g}" for i in range(len(values))], values]
    if not columns:
        return None
    rows = zip_longest(*columns, fillvalue="")
    # A title may have commas.
    return "\n".join(["\t".join(heads), *map("\t".join, rows), ""]).encode()
