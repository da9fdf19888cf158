"""A real muscle whose length was imposed, from the data set to the report."""

import pytest

import pellucid
from pellucid.study import datasets
from pellucid.study.results import read_rows

NAME = "rat_soleus_hill"


def test_from_the_data_set_to_the_report(tmp_path):
    try:
        datasets.path(NAME)
    except pellucid._errors.PellucidError as error:
        pytest.skip(str(error))
    study = datasets.init(tmp_path / "s", dataset=NAME)
    assert [fault for fault in pellucid.check(study) if fault.severity == "refuse"] == []
    found = pellucid.calibrate(study)
    found.save(study)
    rows = {row.id: row.value for row in read_rows(study.results_path)}
    assert rows[f"{NAME}.mae_percent"] < 8.9 < rows[f"{NAME}.rigid.mae_percent"]
    assert "Force over imposed length" in pellucid.report(study).read_text(encoding="utf-8")
