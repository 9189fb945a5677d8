"""The report's remarks: what they claim is computed from rows; against the paper they give both numbers."""

import itertools
import re

import numpy as np
import pandas as pd
import pytest

from cccd.comparisons import notes, published
from cccd.comparisons.baselines.reconstructions import RECONSTRUCTIONS
from cccd.comparisons.k_sweep import OWN
from cccd.comparisons.map_surfaces import CLASSICAL, NETWORK
from cccd.comparisons.measures import AS_SMOOTH, BEST
from cccd.comparisons.paper_k import CCCD
from cccd.comparisons.reconstruction_comparison import DENSE, HARRIS
from cccd.comparisons.registry import ITEMS
from cccd.comparisons.summary import Cohort, write_notes

ORGANS = ("brain", "liver", "lungs")
RATES = ["TP rate", "FP rate", "TN rate", "FN rate", "ACC", "MC", "PRE", "SPEC", "DSC", "JI"]

SCORES = {"dice", "dice_3d", "DSC", "MC", "FP rate", "FN rate", "rotation", "scale", "noise"}

#: Words of a sentence that finds something; numbers alone are no verdict.
VERDICT = re.compile(
    r"\b(first|above|fewer|more|less|quickest|quicker|strongest|highest|most|falls|rises|take)\b"
)


def corner_rows(rng) -> pd.DataFrame:
    rows = []
    fused = itertools.product(
        (("harris", "FUSE1 (Harris)"), ("shi_tomasi", "FUSE2 (Shi-Tomasi)"), ("fast", "FUSE3 (FAST)")),
        ("paper, Figure 9", "paper, Table 2", "best of grid"),
        ("mask", "grey"),
        ("angle", "tour", "chain"),
    )
    settings = [(*detector, *rest) for detector, *rest in fused]
    settings += [
        ("cccd", CCCD, name, "chain code", "chain")
        for name in ("k = 3", "k = 5", "k = 7", "k = 20", "automatic")
    ]
    for organ, (detector, method, parameters, image, order) in itertools.product(ORGANS, settings):
        found = int(rng.integers(40, 90))
        rows.append(
            {"case": "a", "organ": organ, "slice": 0, "detector": detector, "method": method}
            | {"parameters": parameters, "image": image, "order": order, "values": "", "boundary_pixels": 200}
            | {"corners": found, "on_boundary": int(rng.integers(1, found)), "control_points": found}
            | {"self_intersects": bool(rng.integers(2)), "corner_ms": rng.uniform(1, 9)}
            | {"curve_ms": rng.uniform(1, 9)}
            | dict(zip(RATES, rng.uniform(0, 1, len(RATES)), strict=True))
        )
    return pd.DataFrame(rows)


def link_rows(rng) -> pd.DataFrame:
    titles = [*(method.title for method in RECONSTRUCTIONS.values()), CCCD]
    return pd.DataFrame(
        {"case": "a", "organ": organ, "slice": 0, "points": points, "method": method, "given": "points"}
        | {
            "n_points": 50,
            "connected": rng.integers(1, 9),
            "disconnected": rng.integers(0, 9),
            "open_ends": 0,
        }
        | {"junctions": 0, "left_out": rng.integers(0, 9), "closed": bool(rng.integers(2))}
        | {"dice": rng.uniform(), "ms": rng.uniform(1, 9)}
        for organ, points, method in itertools.product(ORGANS, (DENSE, HARRIS), titles)
    )


def sweep_rows(rng, scores=None) -> pd.DataFrame:
    ks = (3, 5, 7, 12, 20)
    series = [("k-cosine", criterion, n, k) for criterion in ("max", "min") for n, k in enumerate(ks)]
    series += [("Beus-Tiu", OWN, None, np.nan), ("Cheng-Hsu", OWN, None, np.nan)]
    changes = ("rotation", "scale", "noise")
    return pd.DataFrame(
        {"case": "a", "organ": organ, "detector": detector, "criterion": criterion, "k": k, "JI": 1.0}
        | {"share": rng.uniform(), "ACC": 1.0, "too_few": 0.0}
        | dict(zip(changes, rng.uniform(size=3), strict=True))
        | {"DSC": rng.uniform() if scores is None or n is None else scores[organ, criterion][n]}
        for organ, (detector, criterion, n, k) in itertools.product(ORGANS, series)
    )


def corner_surface_rows(rng) -> pd.DataFrame:
    return pd.DataFrame(
        {"case": "a", "organ": organ, "k": k, "slices": 12, "share": rng.uniform(), "dice_2d": rng.uniform()}
        | {"dice_3d": rng.uniform(), "assd_mm": rng.uniform(), "stack_bytes": 1e5, "image_bytes": 1e8}
        | {"seconds": rng.uniform()}
        for organ, k in itertools.product(ORGANS, ("3", "5", "7", "12", "20", "automatic"))
    )


def stage_rows(rng) -> pd.DataFrame:
    methods = (CCCD, "FAST, 2-opt tour", "Harris, Crawl")
    return pd.DataFrame(
        {"case": "a", "organ": organ, "method": method, "total_ms": rng.uniform(10, 99), "surface_ms": 9.0}
        | {"closed_share": 1.0, "dice_3d": rng.uniform()}
        for organ, method in itertools.product(ORGANS, methods)
    )


def surface_rows(rng) -> pd.DataFrame:
    methods = [("CCCD", None), ("marching cubes", None), ("surface nets", None)]
    methods += [("flying edges + windowed sinc", BEST), ("anti-aliased binary + windowed sinc", AS_SMOOTH)]
    figures = ("bending_per_area_mm2", "curvature_per_area_mm", "assd_mm")
    return pd.DataFrame(
        {"case": "a", "organ": organ, "method": method, "chosen": chosen, "setting": "pass band 0.1"}
        | dict(zip(figures, rng.uniform(0.1, 10, len(figures)), strict=True))
        for organ, (method, chosen) in itertools.product(ORGANS, methods)
    )


def segmenter_rows(rng) -> pd.DataFrame:
    networks = [name.replace("nnU-Net", "nnU-Net (plain)") for name in published.NETWORKS["method"][:5]]
    cccd = [f"{CCCD}, k = {k}" for k in (3, 7, 12)]
    pairs = [(name, "the image") for name in networks]
    pairs += [(method, given) for given in ("the true mask", *networks) for method in cccd]
    return pd.DataFrame(
        {"case": "a", "organ": "liver", "method": method, "given": given}
        | {"dice_percent": rng.uniform(90, 99), "assd_mm": rng.uniform(0.1, 1)}
        for method, given in pairs
    )


def made(seed=3) -> dict[str, pd.DataFrame]:
    rng = np.random.default_rng(seed)
    snakes = pd.DataFrame(
        {
            "case": "a",
            "organ": organ,
            "slice": 0,
            "method": "snake",
            "setting": setting,
            "dice": rng.uniform(),
        }
        for organ, setting in itertools.product(ORGANS, ("a", "b", "grid"))
    )
    ordered = pd.DataFrame(
        {
            "case": "a",
            "organ": organ,
            "slices": 40,
            "decided": 3,
            "dice": 0.999,
            "dice_decided": rng.uniform(),
        }
        for organ in ORGANS
    )
    mapped = pd.DataFrame(
        {"case": "b", "organ": organ, "method": method, "slices": 30, "decided": 20}
        | {"assd_mm": rng.uniform(1, 9), "hd95_mm": 9.0}
        for organ, method in itertools.product(("brain", "kidney"), (NETWORK, CLASSICAL))
    )
    return {
        "corners": corner_rows(rng),
        "reconstruction": link_rows(rng),
        "k_sweep": sweep_rows(rng),
        "corner_surfaces": corner_surface_rows(rng),
        "stage_times": stage_rows(rng),
        "isosurfaces": surface_rows(rng),
        "thick_slices": surface_rows(rng).assign(every_nth=5),
        "active_contour": snakes,
        "map_surfaces": mapped,
        "segmenters": segmenter_rows(rng),
        "ordering": ordered,
    }


def turned(rows: dict[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """The same cohort with every score and time turned round, so that the best is the worst."""
    changed = {}
    for name, frame in rows.items():
        frame = frame.copy()
        for column in {
            "dice",
            "dice_3d",
            "DSC",
            "MC",
            "FP rate",
            "FN rate",
            "rotation",
            "scale",
            "noise",
        } & set(frame):
            frame[column] = 1 - frame[column]
        inverted = {
            "ms",
            "total_ms",
            "corner_ms",
            "curve_ms",
            "bending_per_area_mm2",
            "curvature_per_area_mm",
            "assd_mm",
        }
        for column in inverted & set(frame):
            frame[column] = 1 / frame[column]
        if "dice_percent" in frame:
            frame["dice_percent"] = 100 - frame["dice_percent"]
        if "closed" in frame:
            frame["closed"] = ~frame["closed"]
        if "on_boundary" in frame:
            frame["on_boundary"] = frame["corners"] - frame["on_boundary"]
            frame["control_points"] = 130 - frame["control_points"]
        if "decided" in frame:
            frame["decided"] = frame["slices"] - frame["decided"]
        changed[name] = frame
    return changed


def sentences(text: str) -> list[str]:
    return [part for part in re.split(r"(?<=[.])\s+(?=[A-Z“])", text) if part]


def verdict(sentence: str) -> str:
    """A sentence without its measurements: words, and counts such as 2 of 3, are left."""
    return re.sub(r"(?<![\d.])(?<!k = )[\d.]+(?:e-?\d+)?(?! of \d)(?<! of \d)", "#", sentence)


@pytest.fixture(scope="module")
def spoken():
    return {
        name: write_notes(Cohort(rows)) for name, rows in (("as made", made()), ("turned", turned(made())))
    }


def test_the_cohort_has_every_note_of_the_rows(spoken):
    noted = {item.key for item in ITEMS if item.note is not None}
    assert noted - set(spoken["as made"]) <= {"compactness", "shapes"}  # which speak of metrics.json


def test_every_finding_changes_with_its_rows(spoken):
    constant = [
        (key, sentence)
        for key, text in spoken["as made"].items()
        for sentence in sentences(text.split("In the paper itself")[0])
        if VERDICT.search(sentence)
        and verdict(sentence) in {verdict(other) for other in sentences(spoken["turned"].get(key, ""))}
    ]
    assert constant == []


def test_what_is_held_against_the_paper_has_both_numbers(spoken):
    for key, text in spoken["as made"].items():
        own = text.split("In the paper itself")[0]
        assert not re.search(r"(as|like|unlike|than) (in )?the paper\b", own), key
        for before, theirs in re.findall(r"([^.(]*(?:\d[^(]*)) \(the paper: ([^)]*)", own):
            assert re.search(r"\d", before), key
            assert re.search(r"\d", theirs), key


def test_no_title_or_caption_finds_an_agreement():
    for item in ITEMS:
        for text in (item.title, item.text, *item.captions):
            assert not re.search(r"\b(as|unlike|agrees?) (in |with )?the paper", text), item.key


@pytest.mark.parametrize(
    "key",
    ["table1", "table2", "table3", "table5", "corner_surfaces"]
    + [f"figure{n}" for n in (9, 10, 11, 12, 13, 14, 15, 16)],
)
def test_the_papers_own_number_stands_beside_ours(spoken, key):
    assert "(the paper: " in spoken["as made"][key]


def lines(**by_organ):
    return {(organ, criterion): by_organ[organ] for organ in ORGANS for criterion in ("max", "min")}


def test_a_rise_with_k_is_named_for_the_structure_that_has_it():
    falls, rises = (0.99, 0.98, 0.97, 0.96, 0.9), (0.99, 0.97, 0.98, 0.96, 0.9)
    rows = sweep_rows(np.random.default_rng(0), lines(brain=falls, liver=rises, lungs=falls))
    text = notes.figure_10(Cohort({"k_sweep": rows}))
    assert "liver rises from 97.00 to 98.00 % from k = 5 to 7" in text
    assert "brain falls at every step" in text
    assert "(the paper: rises from 95.83 to 96.00 % from k = 5 to 7" in text


@pytest.mark.parametrize(("last", "finding"), [(0.95, "maxima take more"), (0.6, "maxima do not take more")])
def test_maxima_cure_the_drop_only_where_they_do(last, finding):
    scores = {
        (organ, criterion): (0.99, 0.98, 0.97, 0.96, last if criterion == "max" else 0.5)
        for organ in ORGANS
        for criterion in ("max", "min")
    }
    text = notes.figure_13(Cohort({"k_sweep": sweep_rows(np.random.default_rng(0), scores)}))
    assert finding in text


def test_figure_11_speaks_of_what_it_draws():
    corners = corner_rows(np.random.default_rng(1))
    shi_tomasi = corners["detector"] == "shi_tomasi"
    drawn = (
        (corners["order"] == "tour")
        & (corners["image"] == "mask")
        & (corners["parameters"] == "paper, Table 2")
    )
    corners.loc[:, "MC"] = 0.2
    corners.loc[shi_tomasi & ~drawn, "MC"] = 0.001
    corners.loc[corners["detector"] == "cccd", "MC"] = 0.01
    assert "FUSE2" not in notes.figure_11(Cohort({"corners": corners}))
    corners.loc[shi_tomasi & drawn & (corners["organ"] == "liver"), "MC"] = 0.002
    assert "on liver FUSE2 (Shi-Tomasi) with 0.002" in notes.figure_11(Cohort({"corners": corners}))


def test_a_baseline_with_the_papers_parameters_is_credited():
    corners = corner_rows(np.random.default_rng(1))
    corners["DSC"] = np.where(corners["detector"] == "cccd", 0.98, 0.5)
    ahead = (corners["detector"] == "fast") & (corners["parameters"] == "paper, Table 2")
    corners.loc[ahead & (corners["organ"] != "lungs"), "DSC"] = 0.99
    text = notes.table_2(Cohort({"corners": corners}))
    assert "With the paper's own parameters the strongest baseline is FUSE3 (FAST)" in text
    assert f"above CCCD at k = 3 on 2 of {len(ORGANS)} organs" in text


def test_the_papers_dice_by_k_is_one_series():
    printed = published.TABLE_2[published.TABLE_2["detector"] == "cccd"]
    by_k = printed["parameters"].str.removeprefix("k = ").astype(int)
    assert dict(zip(by_k, printed["dice_percent"], strict=True)) == published.CCCD_DICE.to_dict()


def test_a_wrong_genus_is_told():
    def surface(organ, bias, **genus):
        figures = {"volume_bias": bias, "genus_true": 1, **genus}
        return {"case": "a", "organ": organ, "curves": {"slices": 9}, "surface": figures}

    sound = [surface("A", 0.01, genus=1), {"case": "a", "organ": "real", "surface": {"genus": 7}}]
    assert notes.shapes(Cohort({}, sound)) == (
        "Genus found / true: A 1 / 1; the true one for 1 of 1. The largest error of a volume is 1.00 %."
    )
    broken = [surface("H", -0.02, genus=0), surface("X", 0.0)]
    text = notes.shapes(Cohort({}, [*sound, *broken]))
    assert "H 0 / 1, X none, as it is not closed / 1; the true one for 1 of 3" in text
    assert text.endswith("2.00 %.")
    assert notes.shapes(Cohort({}, sound[1:])) == ""


def test_a_small_round_organ_without_harris_corners_has_its_remarks():
    rows = made()
    links = rows["reconstruction"]
    said = write_notes(Cohort(rows | {"reconstruction": links[links["points"] != HARRIS]}))
    assert any("for want of Harris corners" in note for note in said.values())
