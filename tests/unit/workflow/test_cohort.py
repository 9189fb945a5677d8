import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ROOT
from support.refusals import refusal

from cccd.errors import InputError
from cccd_workflow.cohort import SCHEMA, naming_row, read_cohort


def write(folder, text):
    path = folder / "sheet.tsv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_defaults_and_location(tmp_path):
    path = write(tmp_path, "organ\tcase\tmask\n\nliver\ta\tm.nii\n\nliver\tb\tn.nii\n")
    first, second = read_cohort(path)
    assert first["location"] == "sheet.tsv row 3"
    assert second["location"] == "sheet.tsv row 5"
    assert (first["case"], first["organ"], first["mask"]) == ("a", "liver", "m.nii")
    assert (first["source"], first["role"], first["image"], first["boundary"]) == ("files", "both", "", "")


def test_spreadsheet_habits(tmp_path):
    """A byte-order mark, CRLF, trailing tabs, quoted lists."""
    path = write(tmp_path, '\ufeffcase\torgan\tmask\tlabel\t\t\r\na\tlobe\tm.nii\t"10,11,12"\t\t\r\n')
    assert read_cohort(path)[0]["label"] == "10,11,12"


def test_every_sheet_in_config_is_sound():
    for path in sorted((ROOT / "config").glob("*.tsv")):
        assert read_cohort(path), path


HEADER = "case\torgan\tsource\timage\tmask\tlabel\tboundary\trole\n"
BAD = {
    "empty file": ("", "empty"),
    "header only": (HEADER, "no rows"),
    "not text": (b"\x89PNG\r\n\x1a\n\xff\xfe\x00", "UTF-8"),
    "NUL byte": (b"case\torgan\tmask\na\0\tliver\tm\n", "row 2"),
    "commas": ("case,organ,mask\na,liver,m.nii\n", "tabs"),
    "unknown column": ("case\torgan\tmaks\na\tliver\tm.nii\n", "did you mean 'mask'?"),
    "column twice": ("case\torgan\tmask\tmask\na\tliver\tm\tm\n", "twice"),
    "no organ column": ("case\tmask\na\tm.nii\n", "'organ' is missing"),
    "empty case": ("case\torgan\tmask\n\tliver\tm.nii\n", "case is empty"),
    "shell in the case": ("case\torgan\tmask\n$(touch x)\tliver\tm.nii\n", "row 2: case '$(touch x)'"),
    "path in the organ": ("case\torgan\tmask\na\t../../x\tm.nii\n", "row 2: organ '../../x'"),
    "umlaut in the case": ("case\torgan\tmask\nMüller\tliver\tm.nii\n", "row 2: case"),
    "dot": ("case\torgan\tmask\n.\tliver\tm.nii\n", "row 2: case '.'"),
    "role": (HEADER + "a\tliver\tfiles\t\tm\t\t\ttrian\n", "did you mean 'train'?"),
    "source": (HEADER + "a\tliver\tmni153\t\t\t\t\t\n", "did you mean 'mni152'?"),
    "label zero": (HEADER + "a\tliver\t\t\tm\t0\t\t\n", "label '0'"),
    "label list": (HEADER + "a\tliver\t\t\tm\t1,,2\t\t\n", "label '1,,2'"),
    "label decimal": (HEADER + "a\tliver\t\t\tm\t1.5\t\t\n", "label '1.5'"),
    "no files": (HEADER + "a\tliver\tfiles\t\t\t\t\t\n", "neither image nor mask nor boundary"),
    "named cohort without scan": (HEADER + "a\tliver\tlits17\t\t\t\t\t\n", "needs an image"),
    "files for a phantom": (HEADER + "a\tliver\tphantom\t\tm.nii\t\t\t\n", "has its own"),
    "duplicate": (
        "case\torgan\tmask\na\tliver\tm\nb\tliver\tm\na\tliver\tn\n",
        "row 4: a/liver is already in",
    ),
    "capitals": ("case\torgan\tmask\na\tliver\tm\na\tLiver\tm\n", "a/Liver and a/liver of sheet.tsv row 2"),
    "folder of tables": ("case\torgan\tmask\ntables\tliver\tm\n", "row 2: results/tables holds the tables"),
    "capitals of a case": ("case\torgan\tmask\na\tliver\tm\nA\tlungs\tm\n", "row 3: A and a of"),
    "too many fields": ("case\torgan\tmask\na\tliver\tm\textra\n", "4 fields under 3 columns"),
    "open quote": ('case\torgan\tmask\na\tliver\t"m\n', "quote"),
    "no seed": ("case\torgan\timage\tseed\na\tliver\tct.nii\t1,2\n", "row 2: seed '1,2' is not known"),
    "empty box": ("case\torgan\timage\tseed\na\tliver\tct.nii\t5:5,1,1\n", "row 2: seed 5:5,1,1 is a box"),
    "seed and mask": (
        "case\torgan\timage\tmask\tseed\na\tliver\tct.nii\tm.nii\t1,2,3\n",
        "row 2: a seed cannot be combined with a mask; empty seed or mask",
    ),
    "seed and label": (
        "case\torgan\timage\tlabel\tseed\na\tliver\tct.nii\t5\t1,2,3\n",
        "a seed cannot be combined with a label",
    ),
    "seed of a phantom": (
        "case\torgan\tsource\tseed\na\tliver\tphantom\t1,2,3\n",
        "source phantom has a mask",
    ),
    "seed that trains": (
        "case\torgan\timage\tseed\trole\na\tliver\tct.nii\t1,2,3\ttrain\n",
        "a mask, not a seed",
    ),
    "line break in a field": ('case\torgan\tmask\na\tliver\t"m\nn"\n', "line break"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_sheet_gives_one_line(tmp_path, name):
    text, expected = BAD[name]
    line = refusal(read_cohort, write(tmp_path, text))
    assert expected in line
    assert line.startswith("sheet.tsv")


def test_missing_sheet_and_folder(tmp_path):
    assert "no such cohort sheet" in refusal(read_cohort, tmp_path / "absent.tsv")
    assert "cannot be read" in refusal(read_cohort, tmp_path)


field = st.text(st.characters(codec="utf-8"), max_size=12) | st.sampled_from(
    ["case", "organ", "mask", "liver", "files", "$(touch x)", "../../x", "5", '"', "\t", "\n"]
)


@settings(deadline=None)
@given(st.lists(st.lists(field, max_size=5), max_size=5))
def test_any_text_is_read_or_refused_in_one_line(tmp_path_factory, table):
    path = write(tmp_path_factory.getbasetemp(), "\n".join("\t".join(record) for record in table))
    try:
        rows = read_cohort(path)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        columns = set(yaml.safe_load(SCHEMA.read_text())["properties"]) | {"location"}
        assert all(set(row) == columns for row in rows)


@settings(deadline=None)
@given(st.text(max_size=8) | st.text("aZ9_-./$; ", min_size=1, max_size=4))
def test_names_are_safe_in_paths_and_shells(tmp_path_factory, name):
    path = write(tmp_path_factory.getbasetemp(), f"case\torgan\tmask\n{name}\tliver\tm.nii\n")
    try:
        (row, *_) = read_cohort(path)
    except InputError:
        return
    assert row["case"]
    assert all(c.isascii() and (c.isalnum() or c in "_-") for c in row["case"])


def test_what_goes_wrong_with_a_structure_names_its_row(tmp_path):
    sheet = tmp_path / "sheet.tsv"
    sheet.write_text("case\torgan\tsource\na\tliver\tphantom\n\nb\tlungs\tphantom\n")
    with pytest.raises(InputError) as caught, naming_row(sheet, "b/lungs"):
        raise InputError("b/lungs", "mask: it is empty", "give another")
    assert str(caught.value) == "sheet.tsv row 4: mask: it is empty; give another"
    with naming_row(tmp_path / "not_there.tsv", "b/lungs"):
        pass  # the sheet is read only when something is wrong
