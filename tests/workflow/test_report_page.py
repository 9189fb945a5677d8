"""The report in a real browser with the network off: it draws, its toggles switch, its slices move."""

import io
import os
import runpy
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cccd.report.page import build_report, build_structure_page
from cccd.store import write_json

ROOT = Path(__file__).parents[2]
SAMPLES = runpy.run_path(str(ROOT / "tests" / "unit" / "report" / "sample_results.py"))
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

#: Software WebGL, and no calls home of the browser's own.
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
]
CONFIG = {"seed": 152, "report": {"pages_above": 12}}
TEMPLATES = ROOT / "workflow" / "report"
STRUCTURES = [("phantom", "liver"), ("phantom", "kidney")]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    root = tmp_path_factory.mktemp("a run with spaces")
    results = SAMPLES["write_run"](root, STRUCTURES, picture=False)
    output = results / "report.html"
    build_report(results, STRUCTURES, [], CONFIG, output, root / "benchmarks", TEMPLATES)
    return output


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def open_page(browser):
    """Open a file with the network off; every complaint and every request is collected."""
    contexts = []

    def open_file(path, **options):
        context = browser.new_context(offline=True, viewport={"width": 1200, "height": 900}, **options)
        contexts.append(context)
        page = context.new_page()
        page.complaints, page.requests = [], []
        page.on("console", lambda message: page.complaints.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("request", lambda request: page.requests.append(request.url))
        page.goto(path if str(path).startswith("about:") else Path(path).as_uri())
        return page

    yield open_file
    for context in contexts:
        context.close()


def open_structure(page, name):
    structure = page.locator(f"#{name}")
    if structure.get_attribute("open") is None:
        structure.locator("summary").first.click()
    page.wait_for_selector(f"#{name}[data-state=ready]", timeout=20_000)
    settle(page)
    return structure


def wait_for(page, condition):
    """Wait until an expression holds (the page forbids the evaluation in it that playwright would use)."""
    for _ in range(200):
        if page.evaluate(f"Boolean({condition})"):
            return settle(page)
        time.sleep(0.05)
    raise AssertionError(f"never came true: {condition}")


def settle(page):
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def pixels(locator) -> np.ndarray:
    """What a canvas shows, as (h, w, 3) int."""
    return np.asarray(Image.open(io.BytesIO(locator.screenshot())).convert("RGB")).astype(int)


def drawn(picture) -> float:
    """Share of the pixels that differ from the picture's corner."""
    return float((np.abs(picture - picture[5, 5]).max(axis=2) > 24).mean())


def test_page_is_silent_and_asks_nobody(report, open_page):
    page = open_page(report)
    open_structure(page, "phantom--liver")
    assert page.complaints == []
    outside = [url for url in page.requests if not url.startswith(("file:", "data:", "blob:"))]
    assert outside == []
    assert [url for url in page.requests if url.startswith("file:")] == [report.as_uri()]


def test_surface_is_drawn_shaded_and_turns(report, open_page):
    page = open_page(report)
    canvas = open_structure(page, "phantom--liver").locator("canvas[data-part=surface]")
    first = pixels(canvas)
    assert 0.12 < drawn(first) < 0.8
    body = first[np.abs(first - first[5, 5]).max(axis=2) > 24]
    assert body.std(axis=0).max() > 15  # a flat patch of one colour would be no surface
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 120, box["y"] + box["height"] / 2, steps=6)
    page.mouse.up()
    settle(page)
    assert (np.abs(pixels(canvas) - first).max(axis=2) > 24).mean() > 0.02


def test_zoom_by_key_enlarges_the_surface(report, open_page):
    page = open_page(report)
    canvas = open_structure(page, "phantom--liver").locator("canvas[data-part=surface]")
    before = drawn(pixels(canvas))
    canvas.focus()
    page.keyboard.press("+")
    page.keyboard.press("+")
    settle(page)
    assert drawn(pixels(canvas)) == pytest.approx(before * 1.2**4, rel=0.1)


def test_toggles_switch_what_is_drawn(report, open_page):
    page = open_page(report)
    structure = open_structure(page, "phantom--liver")
    canvas = structure.locator("canvas[data-part=surface]")
    whole = drawn(pixels(canvas))
    structure.locator("input[data-show=surface]").uncheck()
    settle(page)
    assert drawn(pixels(canvas)) < 0.01
    shares = {}
    for part in ("net", "curves", "cubes"):
        toggle = structure.locator(f"input[data-show={part}]")
        toggle.check()
        settle(page)
        shares[part] = drawn(pixels(canvas))
        toggle.uncheck()
        settle(page)
    assert 0.005 < shares["net"] < whole
    assert 0.005 < shares["curves"] < whole
    assert shares["cubes"] == pytest.approx(whole, rel=0.1)  # the mask's surface is nearly the same body


def test_colour_by_distance_shows_its_legend(report, open_page):
    page = open_page(report)
    structure = open_structure(page, "phantom--liver")
    canvas = structure.locator("canvas[data-part=surface]")
    plain = pixels(canvas)
    for name in ("distance", "curvature", "band"):
        structure.locator("select[data-part=colour]").select_option(name)
        settle(page)
        assert structure.locator(f"[data-legend={name}]").is_visible()
        assert (np.abs(pixels(canvas) - plain).max(axis=2) > 20).mean() > 0.1
    assert not structure.locator("[data-legend=distance]").is_visible()


def test_the_error_band_is_two_lines_on_a_slice(report, open_page):
    page = open_page(report)
    structure = open_structure(page, "phantom--liver")
    wait_for(page, "structures[0].slices && structures[0].slices.sprite")
    canvas = structure.locator("canvas[data-part=slice]")
    both = pixels(canvas)
    structure.locator("input[data-overlay=band]").uncheck()
    settle(page)
    line = np.abs(both - pixels(canvas)).max(axis=2) > 40
    rows = line[line.any(axis=1)]
    middle = rows[len(rows) // 2]
    edges = np.flatnonzero(np.diff(middle.astype(int)) == 1)
    assert len(edges) == 4  # outer, inner, inner, outer
    outer, inner = edges[[0, 3]], edges[[1, 2]]
    assert outer[0] < inner[0] < inner[1] < outer[1]


def test_scrubber_moves_by_mouse_and_key(report, open_page):
    page = open_page(report)
    structure = open_structure(page, "phantom--liver")
    canvas, slider = structure.locator("canvas[data-part=slice]"), structure.locator("[data-part=slider]")
    wait_for(page, "structures[0].slices && structures[0].slices.sprite")
    first, slice_number = pixels(canvas), int(canvas.get_attribute("data-slice"))
    slider.focus()
    page.keyboard.press("ArrowRight")
    settle(page)
    assert int(canvas.get_attribute("data-slice")) == slice_number + 1
    slider.fill("1")
    settle(page)
    assert (np.abs(pixels(canvas) - first).max(axis=2) > 24).mean() > 0.05
    assert (
        structure.locator("[data-part=slice-label]").inner_text().startswith(f"Slice {slice_number}") is False
    )


def test_overlays_lie_where_the_organ_is(report, open_page):
    page = open_page(report)
    structure = open_structure(page, "phantom--liver")
    wait_for(page, "structures[0].slices && structures[0].slices.sprite")
    canvas = structure.locator("canvas[data-part=slice]")
    for name in ("junctions", "isolated_corners", "dropped", "bridged", "curve", "band", "corners"):
        toggle = structure.locator(f"input[data-overlay={name}]")
        if toggle.count():
            toggle.uncheck()
    settle(page)
    both = pixels(canvas)
    structure.locator("input[data-overlay=boundary]").uncheck()
    settle(page)
    image = pixels(canvas)
    boundary = np.abs(both - image).max(axis=2) > 60
    assert 0.005 < boundary.mean() < 0.2
    # the phantom is bright within and dark without: the ring parts the two
    inside = np.zeros_like(boundary)
    for row in np.flatnonzero(boundary.any(axis=1)):
        hit = np.flatnonzero(boundary[row])
        inside[row, hit[0] : hit[-1] + 1] = True
    core, outside = inside & ~boundary, ~inside & ~boundary
    assert np.median(image[core]) - np.median(image[outside]) > 60


def test_second_structure_is_inflated_only_when_opened(report, open_page):
    page = open_page(report)
    open_structure(page, "phantom--liver")
    assert page.evaluate("structures.map(one => Boolean(one.data))") == [True, False]
    open_structure(page, "phantom--kidney")
    assert page.evaluate("structures.map(one => Boolean(one.data))") == [True, True]


def test_closing_and_opening_again_draws_again(report, open_page):
    page = open_page(report)
    structure = open_structure(page, "phantom--liver")
    structure.locator("summary").first.click()
    wait_for(page, "structures[0].viewer === null")
    structure.locator("summary").first.click()
    wait_for(page, "structures[0].viewer !== null")
    assert drawn(pixels(structure.locator("canvas[data-part=surface]"))) > 0.12
    assert [line for line in page.complaints if "CONTEXT_LOST" not in line] == []


def test_tables_sort_and_download(report, open_page):
    page = open_page(report)
    table = page.locator("#table-table1_corners")
    heading = table.locator("th", has_text="Corners").locator("button")
    heading.click()
    assert table.locator("tbody td:nth-child(2)").all_inner_texts() == ["189", "716"]
    heading.click()
    assert table.locator("tbody td:nth-child(2)").all_inner_texts() == ["716", "189"]
    with page.expect_download() as download:
        page.locator("a[data-csv=table-table1_corners]").click()
    assert download.value.suggested_filename == "table1_corners.csv"
    lines = Path(download.value.path()).read_text().splitlines()
    assert lines[0] == "method,corners,false_share_percent"
    assert lines[1] == "Harris,716,67.5"


def test_page_fits_a_phone_and_follows_the_dark_scheme(report, open_page):
    page = open_page(report, color_scheme="dark")
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert (
        sum(page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")) < 120
    )


def test_page_of_one_structure_draws(tmp_path, report, open_page):
    results = report.parent
    output = results / "phantom" / "liver" / "report.html"
    build_structure_page(results, "phantom", "liver", CONFIG, output, TEMPLATES, index=report)
    page = open_page(output)
    structure = open_structure(page, "phantom--liver")
    assert drawn(pixels(structure.locator("canvas[data-part=surface]"))) > 0.12
    page.get_by_text("The whole cohort").click()
    assert page.url == report.as_uri()
    assert page.complaints == []


def test_index_of_200_structures_is_small_and_opens_fast(tmp_path, open_page):
    results = tmp_path / "results"
    rng = np.random.default_rng(5)
    structures = [(f"case_{n:03d}", ("liver", "brain", "lungs")[n % 3]) for n in range(200)]
    noise = Image.fromarray(rng.integers(0, 255, (20, 60), np.uint8))  # harder to pack than any organ
    noise.resize((630, 210)).save(tmp_path / "picture.png")
    for case, organ in structures:
        write_json(results / case / organ / "metrics.json", SAMPLES["make_metrics"](case, organ, rng))
        shutil.copy(tmp_path / "picture.png", results / case / organ)
    output = results / "report.html"
    build_report(results, structures, [], CONFIG, output, None, TEMPLATES)
    assert output.stat().st_size < 5e6
    page = open_page("about:blank")
    # Thread time does not count what other processes take from this one; on an idle machine it is wall time.
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    begin = time.perf_counter()
    page.goto(output.as_uri())
    wall = time.perf_counter() - begin
    measured = {entry["name"]: entry["value"] for entry in session.send("Performance.getMetrics")["metrics"]}
    assert measured["TaskDuration"] < 2.0
    if os.getloadavg()[0] < os.cpu_count() / 2:
        assert wall < 2.0
    assert page.locator("#table-structures tbody tr").count() == 200
    links = page.locator("#table-structures tbody a").evaluate_all(
        "all => all.map(a => a.getAttribute('href'))"
    )
    assert links[0] == "case_000/liver/report.html"
    shown = page.locator("#table-structures tbody tr:visible")
    page.get_by_label("Find").fill("BRAIN case_01")
    assert shown.locator("td:nth-child(1)").all_inner_texts() == [
        "case_010",
        "case_013",
        "case_016",
        "case_019",
    ]
    assert page.locator(".sheet-of-thumbs li:visible").count() == 4
    assert page.locator(".find output").inner_text() == "4 of 200"
    page.get_by_label("Find").fill("")
    assert shown.count() == 200
    assert page.complaints == []
