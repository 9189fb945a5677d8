"""Whole label maps: names from wherever they stand, one row for each label, one line for what is left out."""

import json

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from support.refusals import refusal

from cccd.errors import InputError
from cccd_labels.label_maps import expand_rows, list_map, read_label_table, shared_groups
from cccd_workflow.cohort import read_cohort


def block_map():
    data = np.zeros((12, 12, 12), np.uint8)
    data[1:6, 1:11, 1:11] = 5
    data[6:11, 1:11, 1:11] = 7
    data[2:5, 3:7, 3:7] = 17
    data[0, 0, 0] = 9
    return data


@pytest.fixture
def nifti(tmp_path):
    path = tmp_path / "scan" / "map.nii.gz"
    path.parent.mkdir()
    nib.save(nib.Nifti1Image(block_map(), np.diag([2.0, 2, 2, 1])), path)
    return path


def names(path, table=None):
    return {label.label: label.organ for label in list_map(path, table)}


def test_labels_without_names_are_called_by_their_number_and_one_voxel_is_left_out(nifti):
    assert names(nifti) == {"5": "label_5", "7": "label_7", "9": "label_9", "17": "label_17"}
    assert [label.left_out for label in list_map(nifti)] == ["", "", "a single voxel", ""]


def test_a_folder_of_masks_passes_over_the_empty_ones(tmp_path):
    for name, value in {"liver": 5, "speck": 9, "spleen": 200}.items():
        mask = (block_map() == value).astype(np.uint8)
        nib.save(nib.Nifti1Image(mask, np.eye(4)), tmp_path / f"{name}.nii.gz")
    assert {label.organ: label.left_out for label in list_map(tmp_path)} == {
        "liver": "",
        "speck": "a single voxel",
    }
    for name in ("liver", "speck"):
        (tmp_path / f"{name}.nii.gz").unlink()
    assert "every mask in this folder is empty" in refusal(list_map, tmp_path)


def test_names_come_from_the_file_itself(tmp_path):
    image = sitk.GetImageFromArray(block_map().T)
    for n, (value, name) in enumerate([(5, "liver"), (7, "right kidney")]):
        image.SetMetaData(f"Segment{n}_LabelValue", str(value))
        image.SetMetaData(f"Segment{n}_Name", name)
    path = tmp_path / "map.seg.nrrd"
    sitk.WriteImage(image, path)
    assert names(path) == {"5": "liver", "7": "right_kidney", "9": "label_9", "17": "label_17"}


def test_names_come_from_dataset_json_beside_the_map(nifti):
    labels = {"background": 0, "spleen": 5, "pancreas": 7}
    (nifti.parent / "dataset.json").write_text(json.dumps({"labels": labels}))
    assert names(nifti)["5"] == "spleen"
    assert names(nifti)["7"] == "pancreas"


def test_freesurfer_s_numbers_are_recognised_where_all_of_them_fit(tmp_path):
    numbers = [2, 3, 4, 5, 7, 8, 10, 11, 12, 13, 17, 41, 53, 1035]
    data = np.kron(np.diag(numbers), np.ones((4, 4)))[:, :, None].repeat(4, axis=2)
    path, other = tmp_path / "brain.nii.gz", tmp_path / "body.nii.gz"
    nib.save(nib.Nifti1Image(data.astype(np.int16), np.eye(4)), path)
    found = {label.label: (label.organ, label.colour) for label in list_map(path)}
    assert found["53"] == ("Right-Hippocampus", "#dcd814")
    assert found["1035"] == ("ctx-lh-insula", "#ffc020")
    nib.save(nib.Nifti1Image(np.where(data == 13, 9, data).astype(np.int16), np.eye(4)), other)
    assert names(other)["53"] == "label_53"


TABLES = {
    "names.csv": "label,name,color,code\n5,Liver,#dd8265,SCT^10200004\n7,Spleen,157 108 162,\n",
    "names.tsv": "index\tname\tcolor\n5\tLiver\t#dd8265\n7\tSpleen\t0.6157 0.4235 0.6353\n",
    "lut.txt": "# No. Name R G B A\n0 Unknown 0 0 0 0\n5 Liver 221 130 101 0\n7 Spleen 157 108 162 0\n",
}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_of_any_kind_goes_first(nifti, name):
    table = nifti.parent / name
    table.write_text(TABLES[name])
    found = {label.label: (label.organ, label.colour) for label in list_map(nifti, table)}
    assert found["5"] == ("Liver", "#dd8265")
    assert found["7"] == ("Spleen", "#9d6ca2")
    assert found["17"] == ("label_17", "")


@pytest.mark.parametrize(
    ("text", "problem"),
    [("a,b\n1,2\n", "no columns label"), ("label,name\n5,x\n5,y\n", "is there twice"), ("", "is empty")],
)
def test_a_table_that_is_none_says_so_in_one_line(tmp_path, text, problem):
    path = tmp_path / "names.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=problem):
        read_label_table(path)


def sheet_of(nifti, *rows, columns="case\torgan\tmask\tlabels"):
    sheet = nifti.parent / "sheet.tsv"
    sheet.write_text("\n".join([columns, *rows]) + "\n")
    return read_cohort(sheet)


def test_a_row_for_each_label_and_one_read_of_the_map(nifti):
    rows = sheet_of(nifti, "anna\t*\tmap.nii.gz\t")
    cache = nifti.parent / "cache"
    expanded, labels, notes = expand_rows(rows, nifti.parent, cache)
    assert [(row["organ"], row["label"]) for row in expanded] == [
        ("label_5", "5"),
        ("label_7", "7"),
        ("label_17", "17"),
    ]
    assert len(notes) == 1
    assert "label 9" in notes[0]
    again, _, silent = expand_rows(rows, nifti.parent, cache)
    assert (again, silent) == (expanded, [])
    assert shared_groups(expanded, labels, "auto") == {"anna": ["label_5", "label_7", "label_17"]}
    assert shared_groups(expanded, labels, False) == {}


def test_two_labels_of_one_name_are_told_apart(nifti):
    (nifti.parent / "names.csv").write_text("label,name\n5,Lung\n7,lung\n")
    rows = sheet_of(nifti, "anna\t*\tmap.nii.gz\tnames.csv")
    expanded, _, notes = expand_rows(rows, nifti.parent, nifti.parent / "cache")
    assert [row["organ"] for row in expanded] == ["Lung_5", "lung_7", "label_17"]
    assert any("2 labels are called lung" in note for note in notes)


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        (["anna\t*\tgone.nii.gz\t"], "there is no gone.nii.gz"),
        (["anna\t*\tmap.nii.gz\tgone.csv"], "table of labels cannot be read"),
        (["anna\tlabel_5\tmap.nii.gz\t", "anna\t*\tmap.nii.gz\t"], "is already in sheet.tsv row 2"),
        (["anna\tliver\tmap.nii.gz\tnames.csv"], "without organ"),
        (["anna\t*\t\t"], "no label map"),
    ],
)
def test_what_is_wrong_names_the_row(nifti, rows, problem):
    with pytest.raises(InputError, match=problem) as error:
        expand_rows(sheet_of(nifti, *rows), nifti.parent, nifti.parent / "cache")
    assert error.value.location.startswith("sheet.tsv row")
