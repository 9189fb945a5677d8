"""The pages in a real browser with the network off: they fit, surfaces are drawn, layers switch."""

import io
import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support import ROOT, sample_results

from cccd.store import write_json
from cccd_workflow.report.page import build_report
from cccd_workflow.report.structure_view import build_structure_page

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
CONFIG = {"seed": 152}
TEMPLATES = ROOT / "workflow" / "report"
STRUCTURES = [("phantom", "liver")]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The cohort's page; its structure's page lies beside."""
    root = tmp_path_factory.mktemp("a run with spaces")
    results = sample_results.write_run(root, STRUCTURES, picture=False)
    output = results / "report.html"
    build_report(results, STRUCTURES, [], CONFIG, output, root / "benchmarks", TEMPLATES)
    own = results / "phantom" / "liver" / "report.html"
    build_structure_page(results, "phantom", "liver", CONFIG, own, TEMPLATES, index=output)
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


def pixels(locator) -> np.ndarray:
    """What a part of a page shows, as (h, w, 3) int."""
    return np.asarray(Image.open(io.BytesIO(locator.screenshot())).convert("RGB")).astype(int)


def changed(picture, other) -> float:
    """Share of the pixels that differ."""
    return float((np.abs(picture - other).max(axis=2) > 24).mean())


def test_a_structure_s_surface_is_drawn_turned_coloured_and_switched_off(report, open_page):
    page = open_page(report.parent / "phantom" / "liver" / "report.html")
    viewer = page.locator(".viewer")
    viewer.scroll_into_view_if_needed()
    page.wait_for_selector(".viewer[data-state=ready]", timeout=60_000)
    page.wait_for_timeout(300)
    first = pixels(viewer)
    assert changed(first, first[5, 5]) > 0.08
    box = viewer.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 120, box["y"] + box["height"] / 2, steps=6)
    page.mouse.up()
    page.wait_for_timeout(300)
    turned = pixels(viewer)
    assert changed(turned, first) > 0.02
    viewer.locator(".updatemenu-header").click()
    viewer.locator(".updatemenu-dropdown-button", has_text="distance").click()
    page.wait_for_timeout(500)
    assert viewer.locator(".colorbar").count() == 1
    assert changed(pixels(viewer), turned) > 0.05
    viewer.locator(".legendtoggle").first.click()
    page.wait_for_timeout(1500)  # plotly.js waits for a second click
    assert changed(pixels(viewer), turned) > 0.08
    # Chromium's hint about plotly.js's own canvas is no fault of the page
    assert [line for line in page.complaints if "willReadFrequently" not in line] == []
    assert {url for url in page.requests if not url.startswith(("data:", "blob:"))} == {page.url}


def test_layers_of_the_slices_switch_and_the_page_leads_back(report, open_page):
    page = open_page(report.parent / "phantom" / "liver" / "report.html")
    slices = page.locator(".slices ol")
    both = pixels(slices)
    page.locator(".slices input[value=band]").uncheck()
    without = pixels(slices)
    assert 0.002 < changed(both, without) < 0.2
    page.locator(".slices input[value=curve]").uncheck()
    assert 0.002 < changed(without, pixels(slices)) < 0.2
    page.get_by_text("The whole cohort").click()
    assert page.url == report.as_uri()


def test_tables_sort_and_download(report, open_page):
    page = open_page(report)
    page.locator("#paper > summary").click()
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
    assert page.evaluate("document.documentElement.scrollHeight") < 3000
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert (
        sum(page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")) < 120
    )


def test_page_of_200_structures_is_small_and_opens_fast(tmp_path, open_page):
    results = tmp_path / "results"
    rng = np.random.default_rng(5)
    structures = [(f"case_{n:03d}", ("liver", "brain", "lungs")[n % 3]) for n in range(200)]
    noise = Image.fromarray(rng.integers(0, 255, (20, 60), np.uint8))  # harder to pack than any organ
    noise.resize((630, 210)).save(tmp_path / "picture.png")
    for case, organ in structures:
        write_json(results / case / organ / "metrics.json", sample_results.make_metrics(case, organ, rng))
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
    assert page.locator("#table-overview tbody tr").count() == 200
    links = page.locator("#table-overview tbody a").evaluate_all(
        "all => all.map(a => a.getAttribute('href'))"
    )
    assert links[0] == "case_000/liver/report.html"
    shown = page.locator("#table-overview tbody tr:visible")
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
