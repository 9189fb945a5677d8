"""What the rules ask of a plan: files, settings, code, groups; and how quickly it is made."""

from pathlib import Path

import pytest
from support import fresh, plans
from support.refusals import refusal

from cccd.errors import InputError
from cccd.extras import EXTRAS
from cccd_workflow.plan.checks import PlannedJob, check_jobs, check_slurm, extras_of
from cccd_workflow.plan.networks import MODEL
from cccd_workflow.plan.outcome import failures, report_failed_run, report_good_run
from cccd_workflow.plan.plan import Plan
from cccd_workflow.plan.resources import digest, memory, minutes
from cccd_workflow.report.registry import Comparison, comparisons, inputs

plan_of, named, ROOT = plans.plan_of, plans.named, plans.ROOT

MASK = {"case": "a", "organ": "ball", "mask": "mask.nii.gz"}
MAPS = {"case": "b", "organ": "ball", "boundary": "maps.nii.gz"}
IMAGE = {"case": "c", "organ": "ball", "image": "scan.nii.gz"}
LIVER = {"case": "p", "organ": "liver", "source": "phantom"}


def test_what_orders_pixels_waits_for_the_network_and_nothing_else_does():
    plan = plan_of(MASK, MAPS | {"parts": "2"})
    assert plan.model_files(named("a/ball")) == []
    assert plan.model_files(named("b/ball")) == [MODEL]
    assert plan.decoding(named("a/ball")) == {}
    decoder = plan.config["gnn"]["inference"]
    assert plan.decoding(named("b/ball")) == decoder | {"parts": 2}


def test_distances_are_measured_in_cases_of_more_than_one_organ():
    other = MASK | {"organ": "cube"}
    assert plan_of(MASK, MAPS).distance_files() == []
    assert plan_of(MASK, other, MAPS).distance_files() == ["results/a/distances.csv"]
    assert plan_of(LIVER, LIVER | {"organ": "H"}).distance_files() == []  # phantoms are made each by itself


def test_the_bands_sides_are_files_of_their_own():
    plan = plan_of(MASK, surface={"formats": ["band.nii.gz", "vtp", "band.ply"]})
    ends = ("_inner.nii.gz", "_outer.nii.gz", ".vtp", "_inner.ply", "_outer.ply")
    assert plan.format_files() == [f"results/a/ball/surface{end}" for end in ends]


def test_formats_are_asked_for_besides_the_ply():
    formats = {"formats": ["ply", "stl", "step", "msh"], "case_formats": ["step", "vtu"]}
    plan = plan_of(MASK, MAPS, surface=formats)
    assert plan.format_files() == [
        f"results/{case}/ball/surface.{form}" for form in ("stl", "step", "msh") for case in "ab"
    ]
    assert plan.case_format_files() == [
        f"results/{case}/{file}" for case in "ab" for file in ("scene.step", "volume.vtu")
    ]
    assert plan.solid_reports == [f"results/{{case}}/{{organ}}/solid_{form}.json" for form in ("step", "msh")]


@pytest.mark.parametrize(("formats", "fills"), [([], False), (["step"], False), (["msh"], True)])
def test_measures_wait_for_tetrahedra_of_the_case_where_they_are_asked_for(formats, fills):
    plan = plan_of(MASK, surface={"case_formats": formats})
    assert plan.case_reports(named("a/ball")) == (["results/a/volume.json"] if fills else [])
    assert plan.group_after_filling(named("a/ball")) == ("measured" if fills else "structure")


def test_organs_that_share_walls_meet_before_their_surfaces():
    halves = [{"case": "a", "organ": organ, "mask": "map.nii.gz", "label": organ} for organ in "12"]
    plan = plan_of(*halves, LIVER, surface={"shared_walls": True})
    assert plan.sharing_organs("structure.h5")(named("a/1")) == [
        f"results/a/{organ}/structure.h5" for organ in "12"
    ]
    assert plan.sharing_organs("structure.h5")(named("p/liver")) == []
    assert plan.whole_case("surface.ply")(named("p/liver")) == ["results/p/liver/surface.ply"]
    assert "results/a/scene.html" in plan.scenes()
    assert not any("/p/" in file for file in plan.scenes())


def test_a_region_that_a_threshold_finds_gets_a_picture():
    rows = (MASK, MAPS, IMAGE, {"case": "s", "organ": "brain", "source": "mni152_scan"})
    assert plan_of(*rows).found_regions == [named("c/ball"), named("s/brain")]
    segmented = plan_of(*rows, segmenter="totalsegmentator")
    assert segmented.found_regions == [named("s/brain")]


def test_an_image_alone_gets_the_segmenter_s_mask():
    plain, segmented = plan_of(IMAGE), plan_of(IMAGE, MASK, segmenter="totalsegmentator", compare=True)
    made = ["results/c/ball/segmentation.nii.gz", "results/c/ball/segmentation.json"]
    assert plain.segmentation_files(named("c/ball")) == []
    assert segmented.segmentation_files(named("c/ball")) == made
    assert segmented.segmentation_files(named("a/ball")) == []
    row = segmented.sheet_row(named("c/ball"))
    assert (row["mask"], row["label"]) == (made[0], "1")
    assert segmented.comparison_files(named("a/ball"))
    assert not segmented.comparison_files(named("c/ball"))  # no ground truth


def test_the_report_waits_for_the_structures_pages_and_for_what_comparisons_drew():
    plan = plan_of(MASK, MAPS, compare=True)
    pages = ["results/a/ball/report.html", "results/b/ball/report.html"]
    assert plan.reported_files() == [*pages, *plan.all_comparison_files()]


def test_tables_are_those_that_have_rows():
    assert plan_of(MASK, MAPS).tables() == ["structures"]
    assert plan_of(MASK, MASK | {"organ": "cube"}).tables() == ["structures", "distances"]
    compared = plan_of(MASK, compare=True).tables()
    assert {"structures", "surfaces", "table1_corners", "compactness"} <= set(compared)
    assert {"distances", "map_surfaces", "segmenters", "junctions"}.isdisjoint(compared)


@pytest.mark.parametrize(
    ("rows", "name", "kinds"),
    [
        ([MASK], "a/ball", {"structures", "outlines"}),
        ([MASK, MAPS], "a/ball", {"structures", "outlines", "traced masks"}),
        ([MAPS], "b/ball", {"structures", "maps"}),
        ([LIVER], "p/liver", {"structures", "outlines", "phantoms"}),
        ([MASK | {"role": "measure"}], "a/ball", set()),
    ],
)
def test_the_data_decide_what_is_compared(rows, name, kinds):
    plan = plan_of(*rows, compare=True)
    made = {Path(file).stem for file in plan.comparison_files(named(name))}
    assert made == {one.name for one in comparisons().values() if one.of in kinds}
    tables = set(plan.all_comparison_rows())
    assert {file for file in plan.comparison_files(named(name)) if file.endswith(".csv")} <= tables


def test_a_closer_look_is_a_target_of_its_own_and_the_report_shows_what_is_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plan = plan_of(MASK)
    evidence = plan.evidence_files()
    assert {Path(file).stem for file in evidence} == {
        one.name for one in comparisons().values() if one.further and one.of == "outlines"
    }
    assert plan.comparison_files(named("a/ball")) == []
    for file in evidence:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        Path(file).touch()
    assert plan.comparison_files(named("a/ball")) == evidence
    assert plan_of(MASK, compare=False).comparison_files(named("a/ball")) == []


def test_the_default_run_makes_the_longest_comparisons_of_the_first_structure_whose_truth_is_known():
    made = Plan.make({}, ROOT).all_comparison_rows()
    longest = {one.name for one in comparisons().values() if one.further == "others"}
    assert longest == {"isosurfaces", "segmenters"}
    assert {file.removeprefix("results/") for file in made if Path(file).stem in longest} == {
        "phantom/liver/comparisons/isosurfaces.csv",
        "phantom/liver/comparisons/segmenters.csv",
    }
    assert "results/phantom/lungs/comparisons/algorithm_1.csv" in made
    assert "results/phantom/lungs/comparisons/isosurfaces.csv" in Plan.make({}, ROOT).evidence_files()


def test_a_calibration_of_ones_own_is_an_input_of_surfaces(tmp_path):
    own = tmp_path / "own.json"
    with pytest.raises(InputError, match=r"surface\.calibration: there is no file .*own\.json"):
        _ = plan_of(MASK, surface={"calibration": str(own)}).calibration
    own.write_text("{}")
    assert plan_of(MASK, surface={"calibration": str(own)}).calibration == [str(own)]
    assert plan_of(MASK).calibration == []


def test_the_default_cohort_is_compared_and_others_where_they_ask():
    assert Plan.make({}, ROOT).all_comparison_files()
    assert not Plan.make({"compare": False}, ROOT).all_comparison_files()
    assert not plan_of(MASK, MAPS, LIVER).all_comparison_files()
    assert plan_of(MASK, MAPS, LIVER, compare=True).all_comparison_files()


def test_a_comparison_gets_the_settings_that_it_names_and_no_other():
    sections = {"curves": "curves", "inference": "gnn.inference", "seed": "seed"}
    comparison = Comparison("c", "m.run", (), sections, unused=("curves.ordering",))
    plan = plan_of(MASK, curves={"k": 9})
    settings = plan.comparison_settings(comparison)
    assert set(settings) == {"curves", "gnn", "seed"}
    assert settings["curves"] == plan.omit("curves", "ordering")
    assert settings["curves"]["k"] == 9
    assert settings["gnn"] == plan.pick("gnn", "inference")


def test_comparisons_of_a_job_keep_their_own_settings_and_share_what_they_read():
    one = Comparison("one", "m.run", ("structure",), {"curves": "curves"}, unused=("curves.k",))
    two = Comparison("two", "n.run", ("structure", "curves"), {"ks": "curves.sweep"})
    plan = plan_of(MASK)
    assert list(plan.comparison_inputs([one, two])) == ["structure", "curves"]
    settings = [plan.comparison_call(comparison)["settings"] for comparison in (one, two)]
    assert settings == [{"curves": plan.omit("curves", "k")}, {"curves": plan.pick("curves", "sweep")}]


def test_what_is_compared_of_a_structure_is_one_job_and_a_closer_look_another():
    rows, cube = (MASK, MAPS, LIVER), MASK | {"organ": "cube"}
    plan, whole = plan_of(*rows, cube), plan_of(*rows, compare=True)
    jobs = plan.comparison_jobs()
    closer = {comparison.name for comparison in comparisons().values() if comparison.further}
    for name in plan.cohort.reconstructed:
        mine = [{one.name for one in together} for together, names in jobs if name in names]
        assert sum(not names <= closer for names in mine) == 1 == len(mine) - (name != named("b/ball"))
        assert len(set.union(*mine)) == sum(map(len, mine))
    named_in = [names for _, names in whole.comparison_jobs()]
    assert sorted(name for names in named_in for name in names) == sorted(whole.cohort.reconstructed)


def test_a_comparison_does_without_the_network_in_a_run_that_uses_none():
    optional = {name for name, one in inputs().items() if one.optional}
    assert optional
    comparison = Comparison("c", "m.run", (*optional,))
    assert set(map(tuple, plan_of(MASK).comparison_inputs([comparison]).values())) == {()}
    assert all(plan_of(MAPS).comparison_inputs([comparison]).values())


def test_a_section_is_picked_by_its_keys():
    plan = plan_of(MASK)
    assert plan.pick("curves", "k", "no_such_key") == {"k": plan.config["curves"]["k"]}
    assert plan.pick("curves", "k") | plan.omit("curves", "k") == plan.config["curves"]
    assert "k" not in plan.omit("curves", "k")


def test_only_an_edit_in_an_imported_module_changes_a_script_s_digest():
    for name in ("library/__init__.py", "library/used.py", "library/given.py", "library/other.py"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text("")
    script = Path("job.py")
    script.write_text("import library.used\n")
    seen = []
    for name in ("library/other.py", "library/given.py", "library/used.py"):
        digest.cache_clear()  # once per plan
        seen.append(digest(script, (Path("library").resolve(),), ("library.given.run",)))
        Path(name).write_text("# edited\n")
    digest.cache_clear()
    seen.append(digest(script, (Path("library").resolve(),), ("library.given.run",)))
    assert seen[0] == seen[1]
    assert len(set(seen)) == 3


def test_a_network_that_is_compared_is_part_of_the_comparison_s_code():
    ours, paper = (plan_of(MAPS, gnn={"network": name}) for name in ("ours", "paper"))
    given = {name for name, one in inputs().items() if "gnn/model.pt" in one.files}
    using = [one for one in comparisons().values() if given & set(one.inputs)]
    others = [one for one in comparisons().values() if not given & set(one.inputs)]
    assert using
    assert all(ours.comparison_library([one]) == paper.comparison_library([one]) for one in others)
    assert ours.import_library(named("b/ball")) != paper.import_library(named("b/ball"))


def test_memory_grows_with_inputs_and_attempts():
    Path("two_mb").write_bytes(b"\0" * 2**21)
    asked = memory(1000, 50)
    assert asked(None, [], 1) == 1000
    assert asked(None, ["two_mb", "not_written_yet"], 1) == 1100
    assert [asked(None, ["two_mb"], attempt) for attempt in (1, 2, 3)] == [1100, 1650, 2475]
    assert [minutes(20)(None, attempt) for attempt in (1, 2, 3)] == [20, 40, 60]


@pytest.mark.parametrize(
    ("rule", "case", "outputs", "extras"),
    [
        ("import_structure", "a", ["structure.h5"], set()),
        ("import_structure", "b", ["structure.h5"], {"gnn"}),
        ("export_surface", "a", ["surface.stl", "surface_inner.nii.gz"], set()),
        ("export_surface", "a", ["surface.step", "solid_step.json"], {"cad"}),
        ("export_surface", "a", ["surface.msh", "surface.step"], {"fe", "cad"}),
        ("fill_case", "a", ["volume.feb"], {"fe"}),
        ("build_scene", "a", ["scene.glb"], set()),
        ("segment_structure", "c", ["segmentation.nii.gz"], set()),
        ("build_report", "a", ["report.html"], set()),
    ],
)
def test_a_job_needs_an_extra_by_what_it_works_on(rule, case, outputs, extras):
    plan = plan_of(MASK, MAPS, IMAGE, segmenter="totalsegmentator")
    assert extras_of(PlannedJob(rule, {"case": case, "organ": "ball"}, outputs), plan) == extras


@pytest.mark.parametrize(
    ("address", "extras"), [("s3://scans/m.nii.gz", {"s3"}), ("https://x.org/m.nii.gz", set())]
)
def test_only_a_bucket_needs_its_own_client(address, extras):
    plan = plan_of(MASK | {"mask": address})
    (path,) = plan.cohort.source_files(named("a/ball"))
    assert extras_of(PlannedJob("fetch_file", {}, [path]), plan) == extras


def test_a_missing_extra_is_named_with_the_job_before_it_starts(monkeypatch):
    monkeypatch.setitem(EXTRAS, "cad", ("no_such_module",))
    plan, wildcards = plan_of(MASK), {"case": "a", "organ": "ball"}
    jobs = [PlannedJob("export_surface", wildcards, ["results/a/ball/surface.step"])]
    with pytest.raises(InputError, match=r"^export_surface a/ball: no_such_module is not installed; "):
        check_jobs(jobs, plan, programs_are_here=True)
    check_jobs(jobs, plan, programs_are_here=False)


def test_the_end_of_a_run_names_every_failure_once_and_every_surface(capsys):
    plan = plan_of(MASK, MAPS)
    for name in ("logs/b/import.log.failed", "logs/a/import.log.failed", "logs/a/again.log.failed"):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(f"{name[5]}/ball: the mask is empty\n")
    assert failures(plan) == ["a/ball: the mask is empty", "b/ball: the mask is empty"]
    report_failed_run(plan)
    said = capsys.readouterr().err
    assert "2 failed:\n  a/ball: the mask is empty\n  b/ball: the mask is empty\n" in said
    assert "--keep-going" not in said  # nothing waits
    report_failed_run(plan_of(MASK, MAPS, MASK | {"case": "d"}))
    assert "--keep-going" in capsys.readouterr().err
    surface = Path("results/a/ball/surface.ply")
    surface.parent.mkdir(parents=True)
    surface.write_text("")
    report_good_run(plan, [str(surface)])  # and where a shape model is
    assert capsys.readouterr().out == f"{surface.resolve()}\n" * 2


def test_what_failed_of_a_row_that_was_removed_is_not_a_failure_any_more():
    for name in ("a/ball", "a/cube", "b/ball", "downloads/0"):
        log = Path("logs") / name / "import_structure.log.failed"
        log.parent.mkdir(parents=True)
        log.write_text(f"{name}: the mask is empty\n")
    assert failures(plan_of(MASK)) == ["a/ball: the mask is empty", "downloads/0: the mask is empty"]


PLANNING = """
import sys
from pathlib import Path
import cccd_workflow.plan.checks, cccd_workflow.plan.outcome
from cccd_workflow.plan.plan import Plan
plan = Plan.make({}, Path(sys.argv[1]))
plan.all_comparison_files(), plan.tables()
print(*sorted({name.split(".")[0] for name in sys.modules}))
"""


def test_planning_imports_neither_arrays_nor_networks_nor_snakemake():
    heavy = {"h5py", "matplotlib", "nibabel", "numpy", "pandas", "pyvista", "scipy", "snakemake", "torch"}
    assert heavy.isdisjoint(fresh.python(PLANNING, ROOT).split())


def test_a_run_on_slurm_is_refused_where_none_answers(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "no Slurm answers here; start the run where" in refusal(check_slurm)
