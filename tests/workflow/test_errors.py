"""Bad and hostile input on the way through the workflow: one clear line, a non-zero exit, nothing lost."""

import nibabel
import numpy as np
import pytest

SHEET = "case\torgan\tsource\tmask\n"


def test_a_bad_sheet_stops_before_any_job_in_one_line(fresh_project):
    """The other ways in which a sheet can be wrong: ``tests/unit/workflow/test_cohort.py``."""
    (fresh_project.folder / "tiny.tsv").write_text(SHEET + "../../x;$(touch x)\tliver\tphantom\t\n")
    run = fresh_project.snakemake(check=False)
    assert run.returncode != 0
    (line,) = [line for line in run.stderr.splitlines() if line.startswith("Error: ")]
    assert "tiny.tsv row 2" in line
    assert "Traceback" not in run.stderr
    assert not fresh_project.results.exists()
    assert not (fresh_project.folder / "x").exists()


def test_a_bad_configuration_names_the_key_and_gives_a_hint(fresh_project):
    """The other keys: ``tests/unit/settings/test_validation.py``."""
    run = fresh_project.snakemake("--dry-run", "--config", "gnn={graphs: {traning: 20}}", check=False)
    assert run.returncode != 0
    (line,) = [line for line in run.stderr.splitlines() if line.startswith("Error: ")]
    assert "gnn.graphs.traning: unknown key; did you mean 'training'?" in line
    assert "Traceback" not in run.stderr


def test_what_is_not_installed_ends_the_run_before_any_job(fresh_project):
    extras = fresh_project.folder / "scripts" / "cccd" / "extras.py"
    extras.write_text(extras.read_text().replace('"OCP"', '"OCP_of_another_machine"'))
    target = "results/tiny/sphere/surface.step"
    step = fresh_project.folder / target
    step.parent.mkdir(parents=True)
    step.write_text("of an earlier run")
    run = fresh_project.snakemake("--force", target, check=False)
    assert run.returncode == 1
    (line,) = [line for line in run.stderr.splitlines() if line.startswith("Error: ")]
    assert line.startswith(
        "Error: export_file tiny/sphere/surface.step: OCP_of_another_machine is not installed"
    )
    assert line.endswith("pip install '.[cad]'")
    assert step.read_text() == "of an earlier run"
    assert not (fresh_project.folder / "logs").exists()


def test_one_bad_structure_keeps_no_other_from_its_surface(tiny_copy):
    sheet = tiny_copy.folder / "tiny.tsv"
    sheet.write_text(
        "case\torgan\tsource\tmask\trole\n"
        "tiny\tsphere\tphantom\t\tboth\ntiny\ttwo_spheres\tphantom\t\tmeasure\n"
        "tiny\ttorus\tphantom\t\tmeasure\nbroken\tliver\tfiles\tnot_there.nii.gz\tboth\n"
    )
    run = tiny_copy.snakemake("--keep-going", check=False)
    assert run.returncode != 0
    (line,) = {line for line in run.stderr.splitlines() if line.startswith("Error: ")}
    assert "broken/liver" in line
    assert "not_there.nii.gz" in line
    assert (tiny_copy.results / "tiny" / "torus" / "surface.ply").exists()
    assert "1 failed:" in run.stderr
    page = (tiny_copy.results / "report.html").read_text()
    assert "not_there.nii.gz" in page
    again = tiny_copy.snakemake("surfaces", check=False)
    assert again.returncode == 1  # all else is finished, and it still is no good run
    assert "1 failed:" in again.stderr
    assert not (tiny_copy.results / "missing_rows").exists()


def test_a_comparison_that_fails_in_a_job_of_several_is_named(tiny_copy):
    registry = tiny_copy.folder / "scripts" / "cccd_paper" / "registry.py"
    registry.write_text(registry.read_text().replace("k_sweep.compare_k", "k_sweep.compare_no_k"))
    run = tiny_copy.snakemake("results/tiny/sphere/comparisons/corners.csv", check=False)
    assert run.returncode != 0
    (line,) = [line for line in run.stderr.splitlines() if line.startswith("Error: ")]
    assert line.startswith("Error: tiny/sphere, k_sweep: AttributeError: ")
    assert line.endswith("; see logs/tiny/sphere/compare_structure.log")


@pytest.mark.parametrize("target", ["results/../../x/structure.h5", "results/$(touch x)/y/structure.h5"])
def test_targets_outside_the_sheet(target, fresh_project):
    assert fresh_project.snakemake("--dry-run", target, check=False).returncode
    assert not (fresh_project.folder / "x").exists()


def test_a_scan_named_like_a_command(fresh_project):
    name = "$(touch hacked); touch hacked #.nii"
    mask = np.zeros((12, 12, 8), np.uint8)
    mask[3:9, 3:9, 2:6] = 1
    nibabel.save(nibabel.Nifti1Image(mask, np.eye(4)), fresh_project.folder / name)
    (fresh_project.folder / "tiny.tsv").write_text(f"case\torgan\tmask\na\tcube\t{name}\n")
    fresh_project.snakemake("results/a/cube/structure.h5")
    assert not list(fresh_project.folder.rglob("hacked"))
