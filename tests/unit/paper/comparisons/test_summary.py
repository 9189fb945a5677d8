import json

import numpy as np
import pandas as pd

from cccd_paper import registry
from cccd_paper.comparisons.cohort_tables import compactness, ordering
from cccd_workflow.report.registry import Comparison, Item
from cccd_workflow.report.summary import build_tables, read_cohort, structures


def test_rows_carry_their_structures_names_and_empty_tables_none(tmp_path):
    files = []
    rows = pd.DataFrame({"case": ["anna"] * 2, "organ": ["a"] * 2, "x": [1, 2]})
    for organ, table in {"a": rows, "b": None}.items():
        file = tmp_path / organ / "t.csv"
        file.parent.mkdir(parents=True)
        file.write_text("\n" if table is None else table.to_csv(index=False))
        files.append(file)
    table = read_cohort(files, []).rows("t")
    assert table.to_dict("list") == {"case": ["anna"] * 2, "organ": ["a"] * 2, "x": [1, 2]}
    assert read_cohort([tmp_path / "b" / "t.csv"], []).rows("corners").empty


def test_what_a_structure_cannot_have_stays_empty(tmp_path):
    whole = {
        "curves": {"slices": 3, "bytes_per_slice": {"png": 9.0}},
        "surface": {"dice_3d": 0.5},
        "ordering": {"method": "traced mask", "slices": []},
    }
    files = []
    for case, parts in {"full": whole, "bare": {"curves": {"slices": 2}, "surface": {}}}.items():
        files.append(tmp_path / f"{case}.json")
        files[-1].write_text(json.dumps({"case": case, "organ": "o", "warnings": ["w"], **parts}))
    (tmp_path / "ordering.csv").write_text("case,organ,isolated_corners,dice\nfull,o,3,0.75\n")
    cohort = read_cohort([tmp_path / "ordering.csv"], files)
    table = structures(cohort).set_index("case")
    assert table.loc["full", "dice_3d"] == 0.5
    assert np.isnan(table.loc["bare", "dice_3d"])
    assert table["warnings"].tolist() == ["w", "w"]
    assert compactness(cohort)["png"].tolist()[0] == 9.0
    counted = ordering(cohort)
    assert counted["case"].tolist() == ["full"]
    assert counted["method"].tolist() == ["traced mask"]
    assert counted["isolated_corners"].tolist() == [3]
    assert counted["GNN against exact tracing, Dice"].tolist() == [0.75]
    without = build_tables(read_cohort([], files))["ordering"]  # a run without a network
    assert without.to_dict("list") == {"case": ["full"], "organ": ["o"], "method": ["traced mask"]}


def test_a_table_is_added_by_one_entry(tmp_path, monkeypatch):
    mine = Comparison("mine", "mine.compare", ("curves",))
    item = Item("mine", "Mine", "What is measured.", rows=(mine,), table="mine")
    monkeypatch.setattr(registry, "ITEMS", [*registry.ITEMS, item])
    (tmp_path / "mine.csv").write_text("case,organ,x\na,b,1\n")
    tables = build_tables(read_cohort([tmp_path / "mine.csv"], []))
    assert tables["mine"].to_dict("list") == {"case": ["a"], "organ": ["b"], "x": [1]}
