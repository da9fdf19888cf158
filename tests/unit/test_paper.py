"""The parts of a paper: figures, tables, methods, checksums and references of one study."""

import hashlib

import pytest
from research.evidence._healthy import healthy

import pellucid
from pellucid.people.study.paper import write_paper
from pellucid.study.procedures.result_tables import ParameterTable
from pellucid.study.procedures.run import run


@pytest.mark.slow
def test_a_study_becomes_the_parts_of_a_paper(tmp_path):
    folder = next(path for path in healthy(tmp_path, 2000, endings=(".csv",)))
    text = (folder / "study.toml").read_text()
    text = text.replace('name = "bench"\n', 'name = "bench"\ncitation = "A. Nobody, 50 % of it"\n', 1)
    (folder / "study.toml").write_text(text)
    study = pellucid.open(folder)
    found = run(study, "identify")
    found.save(study)
    made = write_paper(study)
    assert made == folder / "paper"
    assert sorted(path.suffix for path in (made / "figures").iterdir())[:1] == [".pdf"]
    tables = {path.name: path.read_text() for path in (made / "tables").glob("*.tex")}
    main = (made / "main.tex").read_text()
    for name, table in tables.items():
        assert rf"\input{{tables/{name.removesuffix('.tex')}}}" in main
        assert table.count(r"\begin{tabular}") == table.count(r"\end{tabular}") == 1
    checksum = hashlib.sha256((folder / "recordings" / "sweep.csv").read_bytes()).hexdigest()
    assert f"sweep,sweep.csv,fit,{checksum}" in (made / "recordings.csv").read_text()
    assert checksum[:12] in tables["recordings.tex"]
    methods, references = (made / "methods.tex").read_text(), (made / "references.bib").read_text()
    assert "1 of them were fitted; 0 were held out" in methods
    assert r"\cite{pellucid}" in methods
    assert pellucid.__version__ in methods
    assert r"A. Nobody, 50 \% of it" in references
    parameters = next(t for part in found.each for t in part.tables if isinstance(t, ParameterTable))
    shown = "".join(tables.values())
    assert all(parameter.name.replace("_", " ") in shown for parameter in parameters.parameters)
