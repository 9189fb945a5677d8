"""What `workflow/rules/common.smk` changes in Snakemake: it is still there, it works, and it is still needed.

Where one of these tests fails with another version of Snakemake, look at the function that it calls.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]

#: Three jobs that take no time, run with the hooks of `common.smk`; what happened goes to facts.json.
SNAKEFILE = """
include: "workflow/rules/common.smk"

import json, threading, time

CHANGES = {changes}
FACTS, TIMERS = {{}}, []


class Timer(threading.Timer):
    def start(self):
        TIMERS.append(self)


def keep():
    Path("facts.json").write_text(json.dumps(FACTS | {{"timers": len(TIMERS)}}))


rule everything:
    default_target: True
    input:
        [f"{{i}}.txt" for i in range(3)],
    localrule: True


rule one:
    output:
        "{{i}}.txt",
    shell:
        "touch {{output}}"


onstart:
    threading.Timer = Timer
    for change in CHANGES:
        globals()[change]()
    {at_start}


onsuccess:
    keep()


onerror:
    keep()
"""

#: The main thread gets SIGTERM while it holds the scheduler's lock, as it does when a job is finished.
STRIKE = """
    with workflow.scheduler._lock:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.5)
        FACTS["killed within"] = workflow.scheduler._user_kill
    time.sleep(0.5)
    FACTS["killed after"] = workflow.scheduler._user_kill
    keep()
"""

#: How often a script is looked up that is asked for twice, and the parameters of what evaluates a resource.
COUNT = """
    from inspect import signature
    from snakemake.common import get_function_params
    from snakemake.sourcecache import infer_source_file

    entry, looked = workflow.sourcecache._cache_entry, []
    workflow.sourcecache._cache_entry = lambda file: looked.append(file) or entry(file)
    for _ in range(2):
        workflow.sourcecache.get_path(infer_source_file("sheet.tsv"))
    evaluate = Resource("mem_mb", 1).evaluate
    inspect.signature = lambda function: looked.append(function) or signature(function)
    FACTS["same"] = get_function_params(evaluate) == signature(evaluate).parameters
    FACTS["looked up"] = len(looked)
"""


def run(folder, changes=(), at_start="pass"):
    """Run the three jobs with some of the hooks' changes: exit status, and what happened."""
    for name in ("workflow", "scripts"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "sheet.tsv").write_text("case\torgan\tsource\na\tsphere\tphantom\n")
    (folder / "Snakefile").write_text(SNAKEFILE.format(changes=list(changes), at_start=at_start.strip()))
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--config", "cohort=sheet.tsv"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    facts = folder / "facts.json"
    assert facts.is_file(), done.stderr
    return done.returncode, json.loads(facts.read_text()) | {"console": done.stderr}


@pytest.mark.parametrize(("changes", "timers"), [([], True), (["switch_timers_off"], False)])
def test_snakemake_sets_a_timer_for_finished_jobs_unless_it_is_switched_off(tmp_path, changes, timers):
    status, facts = run(tmp_path, changes)
    assert status == 0
    assert (facts["timers"] > 0) == timers


@pytest.mark.parametrize(("changes", "short"), [([], False), (["shorten_console"], True)])
def test_the_console_has_a_line_for_each_job_in_place_of_snakemake_s_account(tmp_path, changes, short):
    _, facts = run(tmp_path, changes)
    assert (re.search(r"\[\d/4\] one 2: ", facts["console"]) is not None) == short
    assert ("reason: " in facts["console"]) != short


@pytest.mark.parametrize(("changes", "times"), [([], 3), (["look_up_once"], 1)])
def test_scripts_and_the_parameters_of_a_resource_are_looked_up_once(tmp_path, changes, times):
    _, facts = run(tmp_path, changes, COUNT)
    assert facts["same"]
    assert facts["looked up"] == times


def test_sigterm_is_answered_where_the_main_thread_holds_the_scheduler_s_lock(tmp_path):
    status, facts = run(tmp_path, ["answer_signals"], STRIKE)
    assert status != 0
    assert facts["killed within"] is None  # it waits, as its lock is held: in the main thread for ever
    assert facts["killed after"] == "graceful"
