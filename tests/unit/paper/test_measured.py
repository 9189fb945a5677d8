"""`docs/measured.md` is what the program makes of the committed tables, and its verdicts turn with them."""

import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from cccd_paper.comparisons.map_surfaces import NETWORK
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.measured import BENCHMARKS, TABLES, keep_tables, write_page

DOCS = Path(__file__).parents[3] / "docs"


@pytest.fixture
def tables(tmp_path):
    """The committed tables, to be changed."""
    for name in BENCHMARKS:
        shutil.copy(DOCS / f"{name}.csv", tmp_path)
    return Path(shutil.copytree(DOCS / "measured", tmp_path / "measured"))


def change(folder, name, where, **columns):
    table = pd.read_csv(folder / f"{name}.csv")
    chosen = table.eval(where)
    assert chosen.any()
    for column, value in columns.items():
        table[column] = table[column].astype(type(value))
        table.loc[chosen, column] = value
    table.to_csv(folder / f"{name}.csv", index=False)


def page_of(folder):
    return write_page(folder.parent)


def test_the_page_is_what_the_tables_say():
    assert (DOCS / "measured.md").read_text(encoding="utf-8") == page_of(DOCS / "measured")


def test_every_table_names_its_reference():
    page = page_of(DOCS / "measured")
    structures = pd.read_csv(DOCS / "measured" / "structures.csv")
    for _, row in structures.iterrows():
        reference = "its own mask" if pd.isna(row["genus_true"]) else "true surface"
        assert f"| {row['case']}/{row['organ']} | {reference} |" in page
    assert "against the isosurface of its own mask, which keeps the steps" in page


def test_who_is_ahead_at_figure_9_is_read_off_the_table(tables):
    change(tables, "table2_fuse", f"method == '{CCCD}'", dice_percent=10.0)
    assert "FUSE2 has a higher Dice than CCCD at k = 3 on 3 of 3 organs" in flat(page_of(tables))
    change(tables, "table2_fuse", f"method == '{CCCD}'", dice_percent=100.0)
    page = flat(page_of(tables))
    assert "FUSE2 has a higher Dice than CCCD at k = 3 on 0 of 3 organs" in page
    assert "misclassifies least holds" in page


def test_the_image_that_fits_the_paper_is_read_off_the_table(tables):
    fast = (
        "method == 'FUSE3 (FAST)' and organ == 'liver' and order == 'tour' and parameters != 'best of grid'"
    )
    for image in ("mask", "outline", "grey"):
        change(tables, "table2_fuse", f"{fast} and image == '{image}'", dice_percent=1.0)
    change(tables, "table2_fuse", f"{fast} and image == 'grey'", dice_percent=93.0)
    rows = [line for line in page_of(tables).splitlines() if line.startswith("| FUSE3 (FAST), Figure 9")]
    assert [row.rsplit("|", 2)[1].strip() for row in rows] == ["grey"]


def test_who_is_ahead_at_equal_numbers_of_points_is_read_off_the_table(tables):
    change(tables, "equal_points", "detector == 'k-cosine'", DSC=1.0)
    assert "The highest Dice has, at 5 %: k-cosine, chain code; at 10 %: k-cosine" in page_of(tables)


def test_where_the_papers_surface_is_closer_is_named(tables):
    change(tables, "algorithm_1", "method == 'paper'", assd_mm=99.0)
    assert "The paper's surface is closer than ours on 0 of 7." in page_of(tables)
    change(tables, "algorithm_1", "method == 'paper' and organ == 'kidney'", assd_mm=0.001)
    assert "The paper's surface is closer than ours on 1 of 7 (damaged/kidney)." in page_of(tables)


@pytest.mark.parametrize(
    ("assd", "verdict"),
    [(99.0, "the network loses to the best"), (0.01, "the network is closer than the best")],
)
def test_the_network_against_a_threshold_is_read_off_the_table(tables, assd, verdict):
    change(tables, "map_surfaces", f"case == 'head' and method == '{NETWORK}'", assd_mm=assd)
    page = flat(page_of(tables))
    # beside its table, and where it falls short
    assert page.count(f"On head/brain, from an image and a seed, {verdict}") == 2


def test_a_nearer_baseline_is_named_where_it_falls_short(tables):
    change(tables, "surfaces", "method == 'surface nets' and organ == 'liver'", assd_mm=0.001)
    short = page_of(tables).split("## Where it falls short")[1]
    assert "**Full resolution, phantom/liver.** 1 rows of baselines are closer to the true surface" in short


def test_a_wrong_genus_is_told_and_a_right_one_is_not(tables):
    change(tables, "structures", "genus_true == genus_true", genus=7.0, genus_true=7.0)
    assert "**Handles.**" not in page_of(tables)
    change(tables, "structures", "organ == 'liver'", genus=9.0)
    assert "phantom/liver has genus 9, the true surface 7" in page_of(tables)


def test_a_slab_that_another_method_describes_better_is_named(tables):
    change(tables, "stage_times", f"method == '{CCCD}'", dice_3d=1.0)
    assert "**Slabs, " not in page_of(tables)
    change(tables, "stage_times", f"method == '{CCCD}' and organ == 'lungs'", dice_3d=0.1)
    assert "**Slabs, phantom/lungs.**" in page_of(tables)


@pytest.mark.parametrize(("share", "verdict"), [(1.0, "more than"), (0.0, "fewer than")])
def test_unseen_damage_is_told_apart_and_read_off_its_table(tables, share, verdict):
    change(tables.parent, "out_of_distribution", "decoder == 'GNN, shipped'", correct=share)
    page = flat(page_of(tables))
    assert f"gets {share:.2f} of the maps right, {verdict} " in page
    assert page.index("**In distribution**") < page.index("### Out of distribution")


def test_a_run_s_tables_are_kept_in_few_digits(tmp_path):
    results = tmp_path / "results"
    (results / "tables").mkdir(parents=True)
    for name, columns in TABLES.items():
        row = dict.fromkeys(columns, 0.123456789) | {
            "kind": "all ten",
            "image": "mask",
            "criterion": "its own",
        }
        pd.DataFrame([row | {"more": 1}]).to_csv(results / "tables" / f"{name}.csv", index=False)
    spent = tmp_path / "benchmarks" / "a" / "liver" / "loft_surface.tsv"
    spent.parent.mkdir(parents=True)
    spent.write_text("s\tcpu_time\n3.0\t2.5\n")
    keep_tables(results, tmp_path / "kept")
    for name in TABLES:
        kept = (tmp_path / "kept" / f"{name}.csv").read_text()
        assert "more" not in kept
        assert "0.123456" not in kept
    jobs = pd.read_csv(tmp_path / "kept" / "run.csv").query("fact == 'cpu_s'")
    assert jobs[["place", "rule", "value"]].astype(str).to_numpy().tolist() == [
        ["a/liver", "loft_surface", "2.5"]
    ]


def flat(page):
    return re.sub(r"\s+", " ", page)
