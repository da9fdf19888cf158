"""The filter chain that a study's table asks for, with the mains that its fitted recordings show."""

from __future__ import annotations

from ...models.parameter import Verdict
from ...study.study import Study
from ..signals.emg_chain import EmgChain, emg_chain
from ..signals.emg_quality import find_hum
from .muscle_tables import ChainSettings


def study_chain(study: Study, table: ChainSettings) -> EmgChain | None:
    """Return the chain that a table asks for; None where envelopes were recorded."""
    if table.chain == "none":
        return None
    return emg_chain(
        table.chain, find_notch(study, table), band=table.band, lowpass=table.lowpass, rms_window=table.rms_window
    )


def find_notch(study: Study, table: ChainSettings) -> float | None:
    """Return the frequency of the notch that a table asks for [Hz]; None for that of the published chain.

    Only fitted recordings are searched for hum, so that no other influences an envelope.
    """
    if table.mains != "auto":
        return None if table.mains is None else float(table.mains)
    fitted = [r.stream_or_self(table.emg) for r in study.recordings("fit")]
    key = "mains", table.emg, *(r.name for r in fitted)
    if key not in study.found:
        study.found[key] = find_hum(fitted)
    return study.found[key]


def notch_frequencies(chain: EmgChain | None) -> tuple[float, ...]:
    """Return the frequencies that a chain's notches take out [Hz]."""
    return () if chain is None else tuple(s.cutoff[0] for s in chain.stages if s.kind == "notch")


def mains_verdicts(study: Study, table: ChainSettings) -> list[Verdict]:
    """Return a note of the mains that were found, if a table asks for that."""
    if table.mains != "auto" or table.chain == "none":
        return []
    found = find_notch(study, table)
    if found is None:
        text = f"No hum of the mains was found in the fitted recordings: the chain {table.chain} is as published."
    else:
        text = f"Hum of the mains at {found:g} Hz was found in the fitted recordings, and a notch there takes it out."
    return [Verdict("note", text)]
