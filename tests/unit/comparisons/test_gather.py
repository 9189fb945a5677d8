import json

import numpy as np
import pandas as pd

from cccd.comparisons.gather import compactness, gather, structures


def test_rows_carry_their_structures_names_and_empty_tables_none(tmp_path):
    files = []
    for organ, table in {"a": pd.DataFrame({"x": [1, 2], "case": ["old"] * 2}), "b": None}.items():
        file = tmp_path / "anna" / organ / "comparisons" / "t.csv"
        file.parent.mkdir(parents=True)
        file.write_text("\n" if table is None else table.to_csv(index=False))
        files.append(file)
    table = gather(files)
    assert table.to_dict("list") == {"case": ["anna"] * 2, "organ": ["a"] * 2, "x": [1, 2]}
    assert gather(files[1:]).empty


def test_what_a_structure_cannot_have_stays_empty(tmp_path):
    whole = {"curves": {"slices": 3, "bytes_per_slice": {"png": 9.0}}, "surface": {"dice_3d": 0.5}}
    files = []
    for case, parts in {"full": whole, "bare": {"curves": {"slices": 2}, "surface": {}}}.items():
        files.append(tmp_path / f"{case}.json")
        files[-1].write_text(json.dumps({"case": case, "organ": "o", "warnings": ["w"], **parts}))
    table = structures(files).set_index("case")
    assert table.loc["full", "dice_3d"] == 0.5
    assert np.isnan(table.loc["bare", "dice_3d"])
    assert table["warnings"].tolist() == [1, 1]
    assert compactness(files)["png"].tolist()[0] == 9.0
