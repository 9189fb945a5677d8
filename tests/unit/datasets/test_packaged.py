"""Packaged scans, and cohorts in the layout of their download."""

import json

import numpy as np
import pytest
import pyvista
import yaml
from scipy import ndimage
from support import scans
from support.refusals import refusal

from cccd.errors import InputError
from cccd.settings.root import validate_config
from cccd_workflow.cohort import read_cohort


def test_mni152_brain():
    structure = scans.load(".", source="mni152", organ="brain")
    counts = structure.stack("mask").any(axis=(1, 2)).sum()
    assert counts == 155
    volume = structure.mask.sum() / 1000
    assert 1500 < volume < 2100
    assert structure.provenance["nilearn"]
    assert "no organ 'liver'" in refusal(scans.load, ".", source="mni152", organ="liver")


def test_chest_ct():
    lungs, left, right = (
        scans.load(".", source="chest_ct", organ=name) for name in ("lungs", "left_lung", "right_lung")
    )
    assert lungs.mask.sum() == left.mask.sum() + right.mask.sum()
    litres = lungs.mask.sum() * np.prod(lungs.frame.spacing) / 1e6
    assert 4 < litres < 8  # of an adult who breathes in
    inside = lungs.stack("image")[lungs.stack("mask")]
    assert np.median(inside) < -800  # air
    centre = {
        one.organ: (one.frame.affine @ [*(np.argwhere(one.mask).mean(0) + one.origin), 1])[0]
        for one in (left, right)
    }
    assert centre["left_lung"] < 0 < centre["right_lung"]  # x grows to the right
    assert "no organ 'liver'" in refusal(scans.load, ".", source="chest_ct", organ="liver")


def test_chest_ct_without_its_package(monkeypatch):
    monkeypatch.setattr("cccd_datasets.packaged.find_spec", lambda name: None)
    assert "pip install slicerio" in refusal(scans.load, ".", source="chest_ct", organ="lungs")


def lits(folder):
    labels = scans.organ().astype(np.uint8)
    labels[12:20, 10:16, 4:9] *= 2
    scans.write_nifti(folder / "volume-3.nii", scans.grey(labels > 0), scans.affine_of())
    scans.write_nifti(folder / "segmentation-3.nii", labels, scans.affine_of())
    return labels


def test_lits17(tmp_path):
    labels = lits(tmp_path)
    for name, wanted in (("liver", labels > 0), ("tumour", labels == 2)):
        structure = scans.load(tmp_path, source="lits17", organ=name, image="volume-3.nii")
        np.testing.assert_array_equal(scans.full(structure), wanted)
        assert set(structure.provenance["files"]) == {"volume-3.nii", "segmentation-3.nii"}
    with pytest.raises(InputError, match="LiTS17 has no organ 'spleen'"):
        scans.load(tmp_path, source="lits17", organ="spleen", image="volume-3.nii")
    with pytest.raises(InputError, match="is not a LiTS17 volume"):
        scans.load(tmp_path, source="lits17", organ="liver", image="ct.nii")


def test_upenn_gbm(tmp_path):
    name = "UPENN-GBM-00001_11"
    scan = tmp_path / "images_structural" / name
    scan.mkdir(parents=True)
    (tmp_path / "images_segm").mkdir()
    brain = ndimage.binary_fill_holes(scans.organ())
    brain[32:] = False
    stripped = np.where(brain, scans.grey(brain), 0).astype(np.int16)
    stripped[18, 18, 6] = 0  # a dark voxel inside
    scans.write_nifti(scan / f"{name}_T1.nii.gz", stripped, scans.affine_of())
    tumour = np.zeros(brain.shape, np.uint8)
    tumour[15:22, 20:25, 4:8] = 4
    tumour[15:18, 20:25, 4:8] = 1
    scans.write_nifti(tmp_path / "images_segm" / f"{name}_segm.nii.gz", tumour, scans.affine_of())
    image = f"images_structural/{name}/{name}_T1.nii.gz"

    def load(organ_name):
        return scans.load(tmp_path, source="upenn_gbm", organ=organ_name, image=image)

    np.testing.assert_array_equal(scans.full(load("brain")), brain)
    np.testing.assert_array_equal(scans.full(load("tumour")), tumour > 0)


def test_rider_lung_takes_the_ct_and_leaves_the_pet(tmp_path):
    image, lungs = scans.chest((60, 50, 8))
    patient = tmp_path / "RIDER-1129164940" / "09-20-2006-NA-NA-96508"
    scans.write_series(patient / "4.000000-24533", image, scans.dicom_affine())
    scans.write_series(patient / "5.000000-PET", image, scans.dicom_affine(), uid="pet", modality="PT")
    config = yaml.safe_load((scans.ROOT / "config" / "rider_lung.yaml").read_text())
    columns = scans.row(source="rider_lung", organ="lungs", image="RIDER-1129164940")
    structure = scans.load_structure(columns, tmp_path, scans.settings(region=config["import"]["region"]))
    np.testing.assert_array_equal(scans.full(structure), lungs)


def test_totalsegmentator_folder_of_masks(tmp_path):
    """One of them has its first axis the other way round."""
    folder = tmp_path / "segmentations"
    folder.mkdir()
    mask, affine = scans.organ(), scans.affine_of()
    left, right = mask.copy(), mask.copy()
    left[20:], right[:20] = False, False
    flipped = affine.copy()
    flipped[:3, 3] += affine[:3, 0] * (len(mask) - 1)
    flipped[:3, 0] *= -1
    scans.write_nifti(folder / "kidney_left.nii.gz", left.astype(np.uint8), affine)
    scans.write_nifti(folder / "kidney_right.nii.gz", right[::-1].astype(np.uint8), flipped)
    scans.write_nifti(folder / "empty.nii.gz", (left & right).astype(np.uint8), affine)

    def load(organ_name, label=""):
        return scans.load(tmp_path, organ=organ_name, mask="segmentations", label=label)

    np.testing.assert_array_equal(scans.full(load("kidney_left")), left)
    both = load("kidneys", "kidney_left,kidney_right")
    np.testing.assert_allclose(both.frame.affine, affine, atol=1e-4)
    np.testing.assert_array_equal(scans.full(both), mask)
    assert "did you mean 'kidney_left'" in refusal(load, "kidney_lef")
    assert "the mask is empty" in refusal(load, "empty")


def test_totalsegmentator_label_map_with_names(tmp_path):
    import nibabel as nib

    mask = scans.organ()
    image = nib.Nifti1Image(np.where(mask, 5, 0).astype(np.uint8), scans.affine_of())
    xml = '<CaretExtension><Label Key="5" Red="0"><![CDATA[liver]]></Label></CaretExtension>'
    image.header.extensions.append(nib.nifti1.Nifti1Extension(0, xml.encode()))
    nib.save(image, tmp_path / "all.nii.gz")
    for label in ("liver", "5", ""):
        structure = scans.load(tmp_path, organ="liver", mask="all.nii.gz", label=label)
        np.testing.assert_array_equal(scans.full(structure), mask)
    with pytest.raises(InputError, match=r"no label 'spleen'; choose one of 5 \(liver\)"):
        scans.load(tmp_path, organ="spleen", mask="all.nii.gz", label="spleen")


@pytest.mark.parametrize(
    "labels", [{"background": 0, "liver": 2, "spleen": 7}, {"0": "background", "2": "liver", "7": "spleen"}]
)
def test_nnunet_predictions(tmp_path, labels):
    mask = scans.organ()
    stored = np.where(mask, 2, 0).astype(np.uint8)
    stored[0, 0, :4] = 7
    scans.write_nifti(tmp_path / "case_001.nii.gz", stored, scans.affine_of())
    (tmp_path / "dataset.json").write_text(json.dumps({"labels": labels, "file_ending": ".nii.gz"}))
    structure = scans.load(tmp_path, organ="liver", mask="case_001.nii.gz")
    np.testing.assert_array_equal(scans.full(structure), mask)


def whole_body(monkeypatch, folder, value=100):
    mask = scans.organ()
    scan = pyvista.ImageData(dimensions=mask.shape, spacing=(3, 3, 3.005), origin=(0.75, 0.75, 0.75))
    scan["NIFTI"] = np.where(mask, value, -50).ravel(order="F").astype(np.int16)
    liver = pyvista.ImageData(dimensions=mask.shape, spacing=(3, 3, 3.005), origin=(0.75, 0.75, 0.75))
    liver["NIFTI"] = mask.ravel(order="F").astype(np.uint8)
    blocks = pyvista.MultiBlock({"ct": scan, "segmentations": pyvista.MultiBlock({"liver": liver})})

    def download(load=True):
        return blocks if load else str(folder / "s1397.vtm")

    monkeypatch.setattr(pyvista.examples, "download_whole_body_ct_male", download)
    return mask


def test_whole_body_ct(monkeypatch, tmp_path):
    mask = whole_body(monkeypatch, tmp_path)
    structure = scans.load(".", source="whole_body_ct", organ="liver")
    np.testing.assert_array_equal(scans.full(structure), mask)
    assert "did you mean 'liver'" in refusal(scans.load, ".", source="whole_body_ct", organ="livr")
    whole_body(monkeypatch, tmp_path, value=101)
    with pytest.raises(InputError, match="has changed since its first use"):
        scans.load(".", source="whole_body_ct", organ="liver")


def test_whole_body_ct_without_network(monkeypatch):
    def download(load=True):
        raise ConnectionError("HTTPSConnectionPool: Max retries exceeded\nlong story")

    monkeypatch.setattr(pyvista.examples, "download_whole_body_ct_male", download)
    with pytest.raises(InputError, match="row 2: the whole-body CT cannot be downloaded"):
        scans.load(".", source="whole_body_ct", organ="liver")


@pytest.mark.parametrize(
    "name",
    ["lits17", "rider_lung", "upenn_gbm", "whole_body_ct", "totalsegmentator", "paper", "paper_offline"],
)
def test_named_configurations_are_sound(name):
    """Each is a small file of differences laid over the default."""
    default = yaml.safe_load((scans.ROOT / "config" / "config.yaml").read_text())
    config = yaml.safe_load((scans.ROOT / "config" / f"{name}.yaml").read_text())

    def overlay(base, top):
        return {**base, **{k: overlay(base[k], v) if isinstance(v, dict) else v for k, v in top.items()}}

    validate_config(overlay(default, config))
    assert read_cohort(scans.ROOT / config["cohort"])
