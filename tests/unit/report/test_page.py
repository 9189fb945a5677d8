"""Pages from whole, partial and hostile result folders."""

import json
import re
import shutil
from html.parser import HTMLParser

import h5py
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from support import ROOT
from support.sample_results import make_metrics, write_run

from cccd.store import write_json, write_table
from cccd_labels.between import DISTANCES
from cccd_workflow.report import page, svg
from cccd_workflow.report.html_tables import table
from cccd_workflow.report.numerals import number
from cccd_workflow.report.overviews import kinds_of_warnings
from cccd_workflow.report.page import build_report
from cccd_workflow.report.registry import items
from cccd_workflow.report.structure_view import build_structure_page, figure_view
from cccd_workflow.report.summary import benchmark_table, build_tables, read_cohort

TEMPLATES = ROOT / "workflow" / "report"
CONFIG = {"seed": 152, "cohort": "cohort.tsv", "compare": "auto"}
STRUCTURES = [("phantom", "liver")]


class Reader(HTMLParser):
    """Tags with their attributes, texts, and whether every element that was opened was closed."""

    VOID = frozenset({"meta", "link", "img", "input", "br", "use", "path"})

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts, self.stack = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.stack.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.stack.pop() == tag

    def handle_data(self, data):
        if data.strip():
            self.texts.append(data.strip())

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def build(results, structures, output=None, failures=(), benchmarks=None, config=CONFIG):
    output = output or results / "report.html"
    build_report(results, structures, list(failures), config, output, benchmarks, TEMPLATES)
    return output.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run"), STRUCTURES)


def whole_page(results):
    failures = ["other/lungs: mask.nii.gz is empty"]
    return build(results, STRUCTURES, failures=failures, benchmarks=results.parent / "benchmarks")


@pytest.fixture(scope="module")
def text(results):
    return whole_page(results)


def test_page_is_well_formed_and_refers_to_nothing_outside(text):
    page = Reader(text)
    assert page.stack == []
    for tag, attributes in page.tags:
        for key in ("src", "href", "xlink:href", "action", "poster", "srcset"):
            target = attributes.get(key, "#")
            assert target.startswith(("#", "data:", "phantom/")), (tag, key, target)
    assert not re.search(r"url\((?!#|var)|@import|https?://(?!www\.w3\.org)", text)
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    figure_ids = re.compile(r"^[mpc][0-9a-f]{10}$")  # clip paths and marks of the plots, salted per plot
    assert len({one for one in ids if not figure_ids.match(one)}) == len(
        [one for one in ids if not figure_ids.match(one)]
    )


def test_items_are_those_that_the_run_made(text):
    shown = {attributes.get("id") for attributes in Reader(text).all("article")}
    assert {"table1", "figure5", "figure8"} <= shown  # a table, and diagrams that need no data
    assert shown.isdisjoint({"table2", "surfaces", "junctions"})
    assert "did not make" not in text


def test_failures_warnings_and_numbers_stand_open(text, results):
    page = Reader(text)
    assert "other/lungs: mask.nii.gz is empty" in page.texts
    assert ": Cut by the field of view at the top." in page.texts
    metrics = json.loads((results / "phantom" / "liver" / "metrics.json").read_text())
    assert f"{metrics['surface']['dice_3d']:.4f}" in page.texts
    assert {"990 to 1\u202f110", "100 × 80 × 70", "true surface"} <= set(page.texts)
    opened = text[: text.index('<details class="folded"')]
    assert "990 to" in opened
    assert "Cut by the field" in opened
    assert page.all("canvas") == page.all("script")[1:] == []  # no viewer: that is on the structures' pages


def test_provenance_names_config_checksum_and_time(text):
    page = Reader(text)
    assert "ab" * 32 in page.texts
    assert any("compare: auto" in part for part in page.texts)
    assert "loft_surface" in page.texts
    assert "numpy" in page.texts


def test_nothing_at_all_still_makes_a_page(tmp_path):
    text = build(tmp_path / "results", [("a", "b")])
    assert Reader(text).stack == []


@pytest.fixture
def plain(tmp_path, results):
    """Results of a run that compared nothing, with the tables that it makes all the same."""
    shutil.copytree(
        results, tmp_path / "results", ignore=shutil.ignore_patterns("tables", "comparisons", "gnn")
    )
    cohort = read_cohort([], [str(path) for path in (tmp_path / "results").glob("*/*/metrics.json")])
    (tmp_path / "results" / "tables").mkdir()
    for name, frame in build_tables(cohort).items():
        write_table(tmp_path / "results" / "tables" / f"{name}.csv", frame)
    return tmp_path / "results"


def shown(text):
    return re.sub(r"<(style|script).*?</\1>", "", text, flags=re.DOTALL)


def test_without_comparisons_no_word_of_the_paper(plain, monkeypatch):
    monkeypatch.setattr(page, "_draw", lambda item, _: pytest.fail(f"{item.key} is drawn for nobody"))
    text = shown(build(plain, STRUCTURES))
    assert "Dice with the mask" in text
    assert not re.search(r"\bpaper\b|Table \d|Figure \d|Training", text)


def test_distances_between_organs_are_a_table_where_there_are_any(plain):
    assert "Distances between organs" not in shown(build(plain, STRUCTURES))
    case = STRUCTURES[0][0]
    row = dict(zip(DISTANCES, (case, "liver", "kidney", 7.25, 5.5, 8.75), strict=True))
    write_table(plain / case / "distances.csv", pd.DataFrame([row]))
    cohort = read_cohort([], [], [plain / case / "distances.csv", plain / "none" / "distances.csv"])
    frame = build_tables(cohort)["distances"]
    assert frame.to_dict("records") == [row]
    write_table(plain / "tables" / "distances.csv", frame)
    text = shown(build(plain, STRUCTURES))
    assert "Distances between organs" in text
    assert all(number in text for number in ("7.25", "5.5", "8.75"))


def test_a_network_s_scores_stand_alone_where_nothing_else_is_compared(plain):
    (junctions,) = [item for item in items() if item.table == "junctions"]
    frame = pd.DataFrame(columns=list(junctions.columns)).astype(object)
    frame.loc[0] = ["-" if column in ("decoder", "kind") else 1.0 for column in frame]
    write_table(plain / "tables" / "junctions.csv", frame)
    text = shown(build(plain, STRUCTURES))
    assert junctions.title in text
    assert not re.search(r"Table \d|Figure \d|made no comparison|did not make", text)


def test_names_and_texts_are_escaped(tmp_path, results):
    evil, image = "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>'
    results = shutil.copytree(results, tmp_path / "results")
    folder = results / "phantom" / "liver"
    with h5py.File(folder / "structure.h5", "a") as file:
        provenance = json.loads(file.attrs["provenance"])
        provenance |= {"source": evil, "files": [{"path": f"{image}.nii", "sha256": evil}]}
        file.attrs["provenance"] = json.dumps(provenance)
        file.attrs["warnings"] = json.dumps([evil, image, "</script>" + evil])
    metrics = make_metrics("phantom", "liver", np.random.default_rng(0), (evil,))
    write_json(folder / "metrics.json", metrics)
    table = pd.DataFrame({evil: [evil, image], "n": [1, 2]})
    table.to_csv(results / "tables" / "surfaces.csv", index=False)
    texts = [build(results, STRUCTURES, failures=[evil], config=CONFIG | {"cohort": evil})]
    build_structure_page(results, "phantom", "liver", CONFIG | {"cohort": evil}, folder / "a.html", TEMPLATES)
    texts.append((folder / "a.html").read_text(encoding="utf-8"))
    for text in texts:
        assert "&lt;script&gt;alert(1)" in text  # it is shown, as text
        assert evil not in text
        assert "<img src=x" not in text
        assert Reader(text).stack == []


def test_same_inputs_same_bytes(results, text):
    assert whole_page(results) == text


def test_a_structure_s_page_holds_its_figure_and_slices_in_less_than_3_mb(tmp_path, results):
    output = tmp_path / "page.html"
    build_structure_page(results, "phantom", "liver", CONFIG, output, TEMPLATES, index=tmp_path / "all.html")
    text = output.read_text(encoding="utf-8")
    page = Reader(text)
    assert page.stack == []
    assert output.stat().st_size < 3e6
    assert [one.get("class") for one in page.all("div")].count("viewer") == 1
    assert len(page.all("image")) > 20
    assert page.all("a")[0]["href"] == "all.html"
    assert not re.search(r"url\((?!#|var)|@import|https?://(?!www\.w3\.org)", text)


@pytest.mark.parametrize("name", ["structure.h5", "boundaries.h5", "curves.h5", "surface.h5", "metrics.json",
                                  "picture.png", "view.h5"])  # fmt: skip
def test_each_file_may_be_absent(tmp_path, results, name):
    folder = tmp_path / "phantom" / "liver"
    shutil.copytree(results / "phantom" / "liver", folder)
    (folder / name).unlink()
    build_structure_page(tmp_path, "phantom", "liver", CONFIG, folder / "report.html", TEMPLATES)
    assert Reader((folder / "report.html").read_text(encoding="utf-8")).stack == []
    assert Reader(build(tmp_path, STRUCTURES)).stack == []


def test_a_picture_without_opengl_names_the_package(tmp_path, results):
    folder = tmp_path / "phantom" / "liver"
    shutil.copytree(results / "phantom" / "liver", folder)
    stamp = PngInfo()
    stamp.add_text("renderer", "matplotlib")
    Image.new("RGBA", (30, 10)).save(folder / "picture.png", pnginfo=stamp)
    build_structure_page(tmp_path, "phantom", "liver", CONFIG, folder / "report.html", TEMPLATES)
    assert "apt install libosmesa6" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("count", [13, 60])
def test_every_structure_leads_to_its_page_and_is_in_the_charts(tmp_path, count):
    results, rng = tmp_path / "results", np.random.default_rng(3)
    structures = [(f"c{n}", ("liver", "brain")[n % 2]) for n in range(count)]
    for case, organ in structures:
        write_json(results / case / organ / "metrics.json", make_metrics(case, organ, rng))
    page = Reader(build(results, structures))
    links = [link["href"] for link in page.all("a") if link.get("href", "").endswith("report.html")]
    assert links[:count] == [f"{case}/{organ}/report.html" for case, organ in structures]
    assert f"{count} structures reconstructed" in page.texts
    more = Reader(build(results, [*structures, ("bad", "liver")]))
    assert f"{count} of {count + 1} structures reconstructed" in more.texts
    assert len([one for one in page.all("svg") if one.get("class") == "plot"]) == 2
    rows = {"c0 / liver", "c1 / brain"} if count == 13 else {"liver", "brain"}
    assert rows <= set(page.texts)


def test_warnings_of_one_kind_are_one_line():
    texts = {"a": ["Dropped 9 parts (1.5 mm)", "cut"], "b": ["Dropped 12 parts (3 mm)"], "c": ["cut", "x 1"]}
    kinds = kinds_of_warnings([figure_view(name, "c", {"notes": said}) for name, said in texts.items()])
    assert [(kind.text, len(kind.places)) for kind in kinds] == [
        ("Dropped … parts (… mm)", 2), ("cut", 2), ("x 1", 1),
    ]  # fmt: skip


def test_benchmarks_are_summed_per_rule(tmp_path):
    for case, seconds, memory in (("a", 2.0, 100.0), ("b", 5.0, 300.0)):
        folder = tmp_path / case
        folder.mkdir()
        row = {"s": seconds, "h:m:s": "0:00:02", "max_rss": memory, "cpu_time": seconds}
        pd.DataFrame([row]).to_csv(folder / "loft_surface.tsv", sep="\t", index=False)
    (tmp_path / "quick.tsv").write_text("s\th:m:s\tmax_rss\tcpu_time\n0.02\t0:00:00\t-\t-\n")
    (tmp_path / "broken.tsv").write_text("")
    times = benchmark_table(tmp_path)
    assert list(times["rule"]) == ["loft_surface", "quick"]
    loft = times.iloc[0]
    assert (loft["jobs"], loft["total_s"], loft["longest_s"], loft["peak_memory_mb"]) == (2, 7.0, 5.0, 300.0)
    assert np.isnan(times.iloc[1]["peak_memory_mb"])
    assert benchmark_table(tmp_path / "nowhere") is None


def test_table_numbers_line_up_and_keep_their_exact_value():
    shown = table("t", pd.DataFrame({"name": ["a", "b"], "assd_mm": [0.123456, 12.5], "n": [3, 12000]}))
    assert [row[1].text for row in shown.rows] == ["0.12", "12.50"]
    assert [row[1].value for row in shown.rows] == ["0.123456", "12.5"]
    assert [row[2].text for row in shown.rows] == ["3", "12\u202f000"]
    assert (shown.columns[1].heading, shown.columns[1].unit) == ("ASSD", "mm")
    assert number(-3) == "−3"


def test_figures_have_text_and_follow_the_scheme():
    with svg.style():
        figure, axis = svg.axes(4, 3)
        axis.plot([1, 2], [3, 4], marker="o", label="<i>ours</i>")
        axis.plot(np.arange(900), np.arange(900), ".")
        axis.set_xlabel("readable label")
        axis.legend()
        text = svg.to_svg(figure, "key", 'a "title" & more')
    page = Reader(text)
    assert "readable label" in page.texts
    assert "<i>ours" not in text
    assert "#0102" not in text
    assert "var(--series-0)" in text
    assert len(page.all("use")) < 100  # nine hundred marks became a picture
    assert "data:image/webp" in text
