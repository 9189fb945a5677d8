"""The registry names what exists, once, and is light enough to be read at every start of the workflow."""

import inspect
from typing import get_args

from support import SCRIPTS

from cccd.plugins import find, folders
from cccd.settings.root import whole_settings
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, SURFACES
from cccd_paper.settings import IsosurfaceSettings
from cccd_workflow.dependencies import imported_files
from cccd_workflow.report.registry import comparisons, inputs, items, sections


def closure(together) -> set[str]:
    """Library files whose edit runs a job's comparisons again."""
    modules = [function.rpartition(".")[0] for one in together for function in one.functions]
    files = imported_files(SCRIPTS / "compare_structure.py", folders(), modules)
    return {path.relative_to(SCRIPTS).as_posix() for path in files}


def test_keys_and_tables_are_unique():
    keys = [item.key for item in items()]
    assert len(set(keys)) == len(keys)
    stems = [item.table for item in items() if item.table is not None]
    assert len(set(stems)) == len(stems)
    assert {item.section for item in items()} - {"summary"} == set(sections())


def test_every_function_of_an_item_is_there():
    named = [(item.key, function) for item in items() for function in (item.tabulate, item.plots)]
    assert [(key, name) for key, name in named if name is not None and not is_callable(name)] == []


def is_callable(function: str) -> bool:
    """Whether a function of this dotted name can be imported."""
    try:
        return callable(find(function))
    except (ImportError, AttributeError):
        return False


def test_every_function_and_section_of_a_comparison_is_there():
    wrong = []
    for name, comparison in comparisons().items():
        wrong += [(name, function) for function in comparison.functions if not is_callable(function)]
        wrong += [(name, one) for one in set(comparison.inputs) - set(inputs())]
        wrong += [(name, section) for section in comparison.settings.values() if not has_section(section)]
    assert wrong == []


def has_section(dotted: str) -> bool:
    """Whether the settings have a section of this name."""
    settings = whole_settings()()
    for part in dotted.split("."):
        settings = getattr(settings, part, None)
    return settings is not None


def test_the_functions_of_a_comparison_accept_what_its_job_passes():
    wrong = []
    for comparison in comparisons().values():
        passed = [*comparison.inputs, *comparison.settings, *(["seed"] if comparison.seeded else [])]
        try:
            inspect.signature(find(comparison.run)).bind(**dict.fromkeys(passed))
        except TypeError as error:
            wrong.append(f"{comparison.run}: {error}")
        if comparison.figures:
            asked = inspect.signature(find(comparison.figures)).parameters
            wrong += [f"{comparison.figures}: no {name}" for name in asked if name not in passed]
    assert wrong == []


def test_a_caption_is_no_reason_to_compare_again():
    shown = {"cccd_paper/registry.py", "cccd_workflow/report/summary.py"}
    assert shown.isdisjoint(closure(comparisons().values()))


def test_the_configuration_knows_every_surface():
    field = IsosurfaceSettings.model_fields["methods"]
    names = get_args(get_args(field.annotation)[0])
    assert set(names) == {*SURFACES, *FAMILIES}
