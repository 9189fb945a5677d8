"""Values given on the command line reach the plan as what they stand for."""

import pytest


def test_nested_values_are_read(fresh_project):
    settings = [
        "surface={formats: [stl, glb]}",
        "curves={k: 9, sweep: [3, 9], max_control_points: null}",
        "gnn={graphs: {training: 20}, pretrained: null, learning_rate: 1e-3}",
        "import={resample: true, region: {window: [null, -400]}}",
    ]
    plan = fresh_project.planned("--config", *settings)
    assert plan["measure_structure"] == plan["export_surface"] == 2  # both formats in one job


def test_surfaces_alone_wait_for_no_comparison(fresh_project):
    plan = fresh_project.planned("--config", "train=false", "surface={formats: [stl]}", "--", "surfaces")
    on_the_way = ("import_structure", "loft_surface", "export_surface")
    assert plan == {**dict.fromkeys(on_the_way, 2), "surfaces": 1}


def test_one_spline_for_all_cases_is_made_only_where_it_is_asked_for(fresh_project):
    rows = ["case\torgan\tsource", *(f"{case}\tsphere\tphantom" for case in "abc")]
    (fresh_project.folder / "shapes.tsv").write_text("\n".join(rows))
    asked = ["--config", "cohort=shapes.tsv", "train=false", "compare=false"]
    surfaces = dict.fromkeys(("import_structure", "loft_surface"), 3)
    made = surfaces | {"make_template": 5, "fit_shape": 15, "describe_shapes": 1, "shapes": 1}
    assert fresh_project.planned(*asked, "--", "shapes") == made
    assert "fit_shape" not in fresh_project.planned(*asked)


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("surfacess", "surfacess: nothing makes that; did you mean 'surfaces'?"),
        ("shapes", "shapes: no organ is in 3 cases of the sheet; add cases"),
        ("results/tiny/sphere/surface.plyy", "results/tiny/sphere/surface.plyy: nothing makes that; "),
        ("results/tiny/spher/surface.ply", "no structure tiny/spher; did you mean 'tiny/sphere'?"),
    ],
)
def test_a_target_that_does_not_exist_is_one_line(fresh_project, target, said):
    run = fresh_project.snakemake("--dry-run", target, check=False)
    assert run.returncode == 1
    assert said in run.stderr.splitlines()[-1]
    assert "Traceback" not in run.stderr


@pytest.mark.parametrize("verbose", [False, True])
def test_the_console_has_a_line_for_each_job_in_place_of_snakemake_s_account(fresh_project, verbose):
    options = ["--verbose"] if verbose else []
    run = fresh_project.snakemake(*options, "--", "results/tiny/sphere/structure.h5")
    assert ("[1/1] import_structure tiny/sphere: " in run.stderr) != verbose
    assert ("reason: " in run.stderr) == verbose
