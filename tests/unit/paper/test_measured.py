"""`docs/measured.md` shows the committed tables, and what pages say of them holds in them."""

import re

import pandas as pd
import pytest
from keep_tables import TABLES, keep_tables
from page_tables import table, with_tables
from support import ROOT

from cccd_paper.comparisons.map_surfaces import GROWN, NETWORK, THRESHOLD

DOCS = ROOT / "docs"


def measured(name):
    return pd.read_csv(DOCS / "measured" / f"{name}.csv")


def page(path):
    return re.sub(r"\s+", " ", (ROOT / path).read_text(encoding="utf-8"))


@pytest.fixture
def folder(tmp_path):
    rows = "organ,k,dice,sound\nliver,3,0.9912,True\nliver,5,,False\nlungs,3,0.5,True\nlungs,5,12345.6,True\n"
    (tmp_path / "some.csv").write_text(rows)
    return tmp_path


def test_a_block_becomes_the_rows_and_columns_that_it_names(folder):
    shown = with_tables(
        "Before\n\n```table\nfile: some.csv\nrows: organ == 'liver'\ncolumns: k, dice, sound\n```\n\nafter",
        folder,
    )
    lines = ["Before", "", "| k | dice | sound |"]
    lines += ["| --- | --- | --- |", "| 3 | 0.9912 | yes |", "| 5 | – | no |"]
    assert shown.splitlines() == [*lines, "", "after"]


def test_rows_are_grouped_and_spread_by_their_medians(folder):
    assert table(folder, "some.csv", "dice", medians_by="k").splitlines()[2:] == [
        "| 3 | 0.7456 |",
        "| 5 | 12,346 |",
    ]
    spread = table(folder, "some.csv", "dice", medians_by="k", across="organ").splitlines()
    assert spread[0] == "| k | organ liver | organ lungs |"
    assert spread[2] == "| 3 | 0.9912 | 0.5 |"


def test_a_block_without_rows_is_refused(folder):
    with pytest.raises(ValueError, match=r"some\.csv has no rows with organ == 'kidney'"):
        table(folder, "some.csv", "dice", "organ == 'kidney'")


def test_every_block_of_a_page_has_its_rows():
    blocks = [path for path in DOCS.glob("*.md") if "```table" in path.read_text(encoding="utf-8")]
    shown = {path.stem: with_tables(path.read_text(encoding="utf-8"), DOCS) for path in blocks}
    assert not any("```table" in text for text in shown.values())
    for _, row in measured("structures").iterrows():
        assert f"| {row['case']} | {row['organ']} | " in shown["measured"]


def test_the_papers_network_gets_as_many_maps_right_as_the_page_says():
    wanted = "training_maps > 0 and maps == 300 and split.str.startswith('damaged')"
    right = measured("paper_network").query(wanted)["correct"]
    said = f".{100 * right.min():.0f} to .{100 * right.max():.0f} right in 15 trainings"
    assert said in page("docs/paper.md")
    assert right.max() < 0.5


def test_figure_9_is_lost_as_the_pages_say():
    rows = measured("table2_fuse").query("order == 'tour' or method == 'Proposed CCCD'").set_index("organ")
    fuse = rows[(rows["method"].str.startswith("FUSE2")) & (rows["parameters"] == "paper, Figure 9")]
    fuse, own = fuse.query("image == 'mask'"), rows[rows["parameters"] == "k = 3"]
    assert (fuse["dice_percent"] > own["dice_percent"]).all()
    assert (fuse["control_points"] < own["control_points"]).all()
    assert "FUSE2's corners on the mask describe the slices better than CCCD's" in page("docs/measured.md")


def test_the_network_against_a_threshold_and_its_region_is_as_the_pages_say():
    rows = measured("map_surfaces")
    assd = rows.pivot_table(index="case", columns="method", values="assd_mm")
    liver, head = assd.loc["phantom_scan"], assd.loc["head"]
    assert liver[NETWORK] > liver[GROWN]
    assert liver[NETWORK] == pytest.approx(liver[THRESHOLD], rel=0.02)  # "as close as"
    assert head[NETWORK] < min(head[THRESHOLD], head[GROWN])
    readme = page("README.md")
    assert f"({liver[NETWORK]:.2f} mm) than the region that it starts from ({liver[GROWN]:.2f})" in readme
    assert f"chosen by the truth ({liver[THRESHOLD]:.2f})" in readme
    assert f"{head[NETWORK]:.2f} mm from the brain's mask on average, against {head[THRESHOLD]:.2f}" in readme


def test_the_papers_chain_has_the_figures_that_the_pages_quote():
    assd = (
        measured("algorithm_1").query("case == 'phantom' and organ == 'liver'").set_index("method")["assd_mm"]
    )
    ours = measured("structures").query("case == 'phantom' and organ == 'liver'")["assd_mm"].iloc[0]
    said = f"{assd['paper']:.2f} mm from the true surface (ours {ours:.2f})"
    assert said in page("README.md")


def test_a_run_s_tables_are_kept_in_few_digits(tmp_path):
    results = tmp_path / "results"
    (results / "tables").mkdir(parents=True)
    for name, columns in TABLES.items():
        row = dict.fromkeys(columns, 0.123456789) | {"kind": "all ten"}
        pd.DataFrame([row | {"more": 1}]).to_csv(results / "tables" / f"{name}.csv", index=False)
    spent = tmp_path / "benchmarks" / "a" / "liver" / "loft_surface.tsv"
    spent.parent.mkdir(parents=True)
    spent.write_text("s\tcpu_time\n3.0\t2.5\n")
    keep_tables(results, tmp_path / "kept")
    for name in TABLES:
        kept = (tmp_path / "kept" / f"{name}.csv").read_text()
        assert "more" not in kept
        assert "0.123456" not in kept
    run = pd.read_csv(tmp_path / "kept" / "run.csv").astype(str)
    assert run.query("fact == 'cpu_s'")[["place", "rule", "value"]].to_numpy().tolist() == [
        ["a/liver", "loft_surface", "2.5"]
    ]
    assert run.set_index("fact").loc["jobs", "value"] == "1"
