"""The page of the validation in simulation is generated, and each claim names a proof that exists."""

from pathlib import Path

from research.evidence import _simulation_page as page
from research.evidence._supervisor_page import read_results


def test_the_page_is_written_from_the_stored_results():
    assert page.PAGE.read_text(encoding="utf-8") == page.simulation_page(read_results())


def test_each_claim_names_a_proof_once():
    folder = Path(page.__file__).parent
    proofs = [claim.proof for claim in page.CLAIMS]
    assert len(set(proofs)) == len(proofs)
    assert [proof for proof in proofs if not (folder / f"{proof}.py").exists()] == []
