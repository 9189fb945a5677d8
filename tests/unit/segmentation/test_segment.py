"""A scan becomes labels and a surface by shipped weights; what cannot be done is said in one line."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.refusals import refusal

from cccd.errors import InputError
from cccd.inputs.grid import Volume
from cccd.inputs.nifti_export import write_nifti
from cccd.project import PROJECT
from cccd.request import Request, completed
from cccd.settings.imports import ImportSettings, PhantomSettings
from cccd_segmentation.external import run_external
from cccd_segmentation.model import load_segmenter
from cccd_segmentation.networks import networks
from cccd_segmentation.segment import find_segmenter
from cccd_training.segmentation.scans import read_labelled_scan

ROW = dict.fromkeys(("case", "organ", "source", "image", "mask", "label", "boundary", "role"), "")
ROW |= {"case": "p1", "organ": "spleen", "source": "files", "role": "train", "location": "sheet.tsv row 2"}


def test_shipped_weights_are_found_by_name_and_strangers_are_not():
    path, organ = find_segmenter("hippocampus")
    assert path.endswith("nnunet.pt")
    assert organ == "hippocampus"
    assert "there is no file heart" in refusal(find_segmenter, "heart")


@pytest.mark.parametrize(
    ("folder", "networks", "least", "source"),
    [
        ("hippocampus", networks(), 0.84, "files"),
        ("phantom_liver", networks(), 0.95, "phantom"),
        ("phantom_lungs", networks(), 0.95, "phantom"),
    ],
)
def test_shipped_weights_are_small_and_their_scores_are_those_asked_for(folder, networks, least, source):
    for network in networks:
        path = PROJECT / "workflow" / "models" / "segmenters" / folder / f"{network}.pt"
        assert path.stat().st_size <= 3e6
        _, plan = load_segmenter(path)
        assert (plan.network, plan.source) == (network, source)
        scores = pd.read_csv(path.with_name(f"{network}_scores.csv"))
        assert scores["dice"].mean() >= least
        assert scores.groupby("label")["dice"].mean().min() >= least - 0.01


def test_an_installed_segmenter_that_is_absent_is_said(monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="TotalSegmentator is not installed; pip install TotalSegmentator"):
        run_external("totalsegmentator", Volume(np.zeros((4, 4, 4)), np.eye(4), "ct.nii.gz"), "liver")


FAKE_NNUNET = """#!{python}
import sys, nibabel as nib, numpy as np
from pathlib import Path
given = dict(zip(sys.argv[1::2], sys.argv[2::2]))
scan = nib.load(Path(given["-i"], "scan_0000.nii.gz"))
Path(given["-o"]).mkdir()
labels = np.digitize(scan.get_fdata(), [10, 20]).astype(np.uint8)
nib.save(nib.Nifti1Image(labels, scan.affine), Path(given["-o"], "scan.nii.gz"))
"""


def test_nnunet_s_own_command_gets_the_scan_and_its_label_table_names_the_organ(tmp_path, monkeypatch):
    """The command is a stand-in with nnU-Net's arguments and files; nnU-Net itself is not installed here."""
    image = Volume(np.arange(30.0).reshape(2, 3, 5), np.diag([1.0, 2.0, 3.0, 1.0]), "mr.nii.gz")
    model = tmp_path / "nnUNetTrainer__nnUNetPlans__3d_fullres"
    (model / "fold_0").mkdir(parents=True)
    listing = {"channel_names": {"0": "MRI"}, "labels": {"background": 0, "anterior": 1, "whole": [1, 2]}}
    (model / "dataset.json").write_text(json.dumps(listing))
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="is not installed; pip install nnunetv2"):
        run_external(f"nnunetv2:{model}", image, "anterior")
    command = tmp_path / "nnUNetv2_predict_from_modelfolder"
    command.write_text(FAKE_NNUNET.format(python=sys.executable))
    command.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    anterior = run_external(f"nnunetv2:{model}", image, "anterior")
    assert np.array_equal(anterior, (image.data >= 10) & (image.data < 20))
    monkeypatch.setenv("nnUNet_results", str(tmp_path.parent))
    whole = run_external(f"nnunetv2:{tmp_path.name}", image, "Whole")
    assert np.array_equal(whole, image.data >= 10)
    with pytest.raises(InputError, match="no label 'heart'; choose one of anterior, whole"):
        run_external(f"nnunetv2:{model}", image, "heart")
    with pytest.raises(InputError, match="there is no trained nnU-Net elsewhere"):
        run_external("nnunetv2:elsewhere", image, "heart")


def test_an_organ_that_totalsegmentator_lacks_is_said_before_it_runs():
    with pytest.raises(InputError, match="has no livre; did you mean 'liver'"):
        run_external("totalsegmentator", Volume(np.zeros((4, 4, 4)), np.eye(4), "ct.nii.gz"), "livre")


def test_a_label_that_the_mask_lacks_is_named_with_those_there_are(tmp_path):
    labels = np.zeros((5, 5, 5), np.uint8)
    labels[1:3], labels[3] = 1, 4
    write_nifti(tmp_path / "image.nii.gz", labels.astype(np.int16), np.eye(4))
    write_nifti(tmp_path / "mask.nii.gz", labels, np.eye(4))
    row = ROW | {"image": "image.nii.gz", "mask": "mask.nii.gz"}
    found = read_labelled_scan(row, tmp_path, ImportSettings(), (1, 4))
    assert found.labels.tolist() == np.select([labels == 1, labels == 4], [1, 2]).tolist()
    with pytest.raises(InputError, match=r"lacks label 2 .*choose one of 1, 4"):
        read_labelled_scan(row, tmp_path, ImportSettings(), (1, 2))


def test_the_decathlon_s_folders_imply_mask_and_label(tmp_path):
    (tmp_path / "dataset.json").write_text(
        '{"labels": {"0": "background", "1": "Anterior", "2": "Posterior"}}'
    )
    row = ROW | {"source": "msd", "image": "imagesTr/a.nii.gz"}
    request = Request.of_row(row, tmp_path)
    assert completed(replace(request, organ="posterior")).implied == (2,)
    whole = completed(request)
    assert whole.mask == Path("labelsTr/a.nii.gz")
    assert whole.implied == (1, 2)
    assert "is not in imagesTr" in refusal(completed, replace(request, image=Path("a.nii.gz")))


def test_phantoms_that_train_are_others_and_not_cropped_to_the_organ():
    settings = ImportSettings(phantom=PhantomSettings(spacing_mm=(5.0, 5.0, 5.0)))
    scans = [
        read_labelled_scan(
            ROW | {"case": case, "organ": "kidney", "source": "phantom"}, Path(), settings, (), 3
        )
        for case in ("train_1", "train_2")
    ]
    for scan in scans:
        where = np.argwhere(scan.labels)
        room = np.concatenate([where.min(0), np.array(scan.labels.shape) - 1 - where.max(0)])
        assert room.min() * 5 > 15
    assert scans[0].labels.sum() != scans[1].labels.sum()
