import math

import pytest
import yaml
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from support import ROOT
from support.refusals import refusal

from cccd.errors import InputError
from cccd.settings.root import Settings, validate_config, whole_settings


def test_settings_made_in_python_name_the_key_and_a_hint():
    said = refusal(Settings, surface={"smooth": 3})
    assert said == "config key surface.smooth: unknown key; did you mean 'smoothing'?"
    assert "config key seed: -1 is not allowed; " in refusal(Settings, seed=-1)


def test_default_configuration_is_the_models():
    assert (
        validate_config(yaml.safe_load((ROOT / "config" / "config.yaml").read_text())) == whole_settings()()
    )
    assert validate_config({}) == whole_settings()()


#: What is wrong in the section of the curves, and what the line says.
BAD_CURVES = [
    ({"k": 0}, ["config key curves.k", "0", "a number at least 1 ("]),
    ({"k": 2.5}, ["config key curves.k", "2.5", "whole number"]),
    ({"k": True}, ["config key curves.k", "true"]),
    ({"k": "1e-3"}, ["config key curves.k", "'1e-3'", "whole number"]),
    ({"k": "nine"}, ["config key curves.k", "'nine'", "whole number"]),
    ({"k": None}, ["config key curves.k", "null", "keep the default"]),
    ({"k": math.nan}, ["config key curves.k", "nan"]),
    ({"k": "inf"}, ["config key curves.k", "inf"]),
    ({"tolerance_px": math.inf}, ["config key curves.tolerance_px", "inf is not a finite number"]),
    ({"tolerance_px": True}, ["config key curves.tolerance_px", "true"]),
    ({"kk": 5}, ["config key curves.kk", "unknown", "did you mean 'k'?"]),
    ({"k": "nine", "criterium": "max"}, ["config key curves.criterium", "did you mean 'criterion'?"]),
    ({"method": "corner"}, ["config key curves.method", "did you mean 'corners'?"]),
    ({"method": "zzz"}, ["config key curves.method", "'auto' or 'corners'"]),
    ({"max_control_points": -1}, ["config key curves.max_control_points", "-1", "above 0 or null"]),
    ({"sweep": []}, ["config key curves.sweep", "a list with at least 1 item ("]),
    ({"sweep": [1, "x"]}, ["config key curves.sweep.1", "'x'"]),
    ({"sweep": "12"}, ["config key curves.sweep", "'12'", "a list"]),
    ({7: 1}, ["config key curves.7", "unknown"]),
    (None, ["config key curves", "null", "a section of keys"]),
    ([1], ["config key curves", "[1]"]),
    ("k", ["config key curves", "'k'", "a section of keys"]),
]
#: The same in other sections, and deeper.
BAD = [
    ({"sead": 3}, ["config key sead", "did you mean 'seed'?"]),
    ({"import": {"region": {"window": ["low", None]}}}, ["import.region.window", "'otsu' or a list"]),
    ({"import": {"resample": 1}}, ["config key import.resample", "true or false"]),
    ({"surface": {"formats": ["stl", "stl"]}}, ["config key surface.formats", "stl", "twice"]),
    ({"surface": {"formats": ["stp"]}}, ["config key surface.formats.0", "did you mean 'step'?"]),
    ({"comparisons": {"thick_slices": {"spacings_mm": [5, 99]}}}, ["spacings_mm.1", "99", "at most 50"]),
    ({"gnn": {"graphs": {"training": "-1"}}}, ["config key gnn.graphs.training", "'-1'"]),
    ({"gnn": {"pretrained": 3}}, ["config key gnn.pretrained", "text or null"]),
    *[({"curves": curves}, expected) for curves, expected in BAD_CURVES],
]


@pytest.mark.parametrize(("config", "expected"), BAD)
def test_bad_value_names_key_value_and_hint(config, expected):
    line = refusal(validate_config, config)
    assert all(part in line for part in expected)


def as_text(value):
    """What Snakemake's command line makes of nested values: lists and mappings of text."""
    return yaml.load(yaml.safe_dump(value), Loader=yaml.BaseLoader)


def test_text_from_the_command_line_is_read_as_what_it_stands_for():
    plain = whole_settings()().as_config()
    assert as_text(plain)["surface"]["step_tolerance_mm"] == "0.2"
    assert validate_config(as_text(plain)) == whole_settings()()


@hypothesis_settings(max_examples=30, deadline=None)
@given(
    st.fixed_dictionaries(
        {},
        optional={
            "k": st.integers(1, 1000),
            "tolerance_px": st.floats(0, 100, exclude_min=True, allow_subnormal=False),
            "max_control_points": st.none() | st.floats(0.01, 1e6),
            "sweep": st.lists(st.integers(1, 1000), min_size=1, max_size=4),
            "criterion": st.sampled_from(["max", "min"]),
        },
    ),
    st.booleans(),
)
def test_values_come_back_from_yaml_and_from_text(curves, flag):
    settings = validate_config({"curves": curves, "import": {"resample": flag}})
    for key, value in curves.items():
        assert settings.as_config()["curves"][key] == value
    assert settings.import_.resample is flag
    assert validate_config(yaml.safe_load(yaml.safe_dump(settings.as_config()))) == settings
    assert validate_config(as_text(settings.as_config())) == settings


def test_text_stays_text_where_text_is_wanted():
    settings = validate_config({"cohort": "7", "gnn": {"pretrained": "12", "start": "null"}})
    assert (settings.cohort, settings.gnn.pretrained, settings.gnn.start) == ("7", "12", None)


scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
flat = scalars | st.lists(scalars, max_size=3)
values = flat | st.dictionaries(st.text(max_size=5), flat, max_size=3)
GOOD = {"k": 5, "method": "corners", "max_control_points": None, "sweep": [1]}


@hypothesis_settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.dictionaries(
        st.sampled_from(["seed", "curves", "surface", "x"]),
        values
        | st.just(GOOD)
        | st.dictionaries(st.sampled_from(["k", "sweep", "formats", "source"]), values, max_size=2),
        max_size=3,
    )
)
def test_anything_is_accepted_or_refused_in_one_line(config):
    try:
        settings = validate_config(config)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
        assert "config" in str(error)  # noqa: PT017
    else:
        assert set(config) <= {"seed", "curves", "surface"}
        assert 0 <= settings.seed < 2**32
        assert validate_config(settings.as_config()) == settings
