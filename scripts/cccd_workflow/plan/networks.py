"""The networks of a run: which junction network orders boundary pixels, and what makes masks of images."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from cccd.errors import InputError, nearest
from cccd.plugins import table
from cccd.settings.root import Settings
from cccd_networks.model_header import check_model, check_start, read_segmenter_plan
from cccd_networks.settings import NetworkSettings
from cccd_segmentation.networks import networks
from cccd_segmentation.settings import INSTALLED_SEGMENTERS, is_installed_segmenter
from cccd_workflow.plan.cohort import PlannedCohort, near

#: The junction network in use.
MODEL = "results/gnn/model.pt"


def find_file(name: str, root: Path) -> Path:
    """Find a file that the configuration names.

    The name is absolute, or relative to here, to where the command was typed, or to the project. Of a file
    that is nowhere, return the path in the project.
    """
    folders = [Path.cwd(), Path(os.environ.get("PWD", ".")), root]
    found = [folder / name for folder in folders if (folder / name).is_file()]
    return found[0] if found else root / name


@dataclass(frozen=True)
class JunctionPlan:
    """The junction network of a run.

    Attributes
    ----------
    network : str
        ``ours`` or ``paper``.
    trained : bool
        Whether this run trains it; otherwise ``ready`` is taken.
    named : bool
        Whether the configuration names a ready model.
    used : bool
        Whether this run trains a network, names one, or needs one.
    scored : bool
        Whether networks are compared: the one that this run trains or names, or, if the run compares at all,
        the one that it needs.
    ready : str
        The model that is taken where none is trained.
    start : tuple of str
        The model, if any, from whose weights training starts.
    shipped, shipped_paper : str
        The models that come with the project: ours, the paper's.
    """

    network: str
    trained: bool
    named: bool
    used: bool
    scored: bool
    ready: str
    start: tuple[str, ...]
    shipped: str
    shipped_paper: str

    @classmethod
    def choose(cls, settings: Settings, cohort: PlannedCohort, root: Path) -> JunctionPlan:
        """Choose the network.

        What a job would refuse is refused here: one that starts loses its outputs, and with them a model that
        was trained before.

        Raises
        ------
        InputError
            A configuration that asks for two ways, or a model that is not there or does not fit.
        """
        gnn = cast(NetworkSettings, settings.gnn)  # the section as `cccd_networks` adds to it
        trained = _is_trained(settings, gnn, cohort, root)
        models = root / "workflow" / "models"
        shipped, shipped_paper = near(models / "junctions.pt"), near(models / "paper.pt")
        start = _model_files("start", gnn.start, root)
        named = _model_files("pretrained", gnn.pretrained, root)
        ready = named[0] if named else {"ours": shipped, "paper": shipped_paper}[gnn.network]
        for path in start:
            check_start(path, gnn)
        if not trained:
            check_model(ready, gnn.network)
        used = trained or bool(named) or cohort.needs_network
        scored = trained or bool(named) or (used and cohort.is_asked(settings.compare, root))
        return cls(gnn.network, trained, bool(named), used, scored, ready, start, shipped, shipped_paper)

    @property
    def compared(self) -> dict[str, str]:
        """The models that are compared, by the names that the table gives them."""
        if self.network == "paper":
            models = {f"the paper's, {'trained here' if self.trained else 'taken'}": MODEL}
        else:
            made_or_named = self.trained or self.named
            models = {"trained here" if self.trained else "pretrained": MODEL} if made_or_named else {}
            models["the paper's, shipped"] = self.shipped_paper
        return models | {"shipped": self.shipped}

    @property
    def training_files(self) -> list[str]:
        """What the report reads of the training; there is none for a model that is taken."""
        return ["results/gnn/graphs.h5", "results/gnn/history.csv"] if self.trained else []

    @property
    def score_files(self) -> list[str]:
        """What the report reads of the network's scores."""
        return ["results/tables/junctions.csv"] if self.scored else []

    def code(self, *, paper: bool = False, training: bool = False) -> list[str]:
        """Paths of the code that another package adds for this network, or the paper's; of ours none.

        With ``training`` also of what trains it (`cccd.plugins`).
        """
        network = "paper" if paper else self.network
        tables = map(table, ("JUNCTION_NETWORKS", "JUNCTION_TRAINING")[: 1 + training])
        return [rows[network] for rows in tables if network in rows]


def _is_trained(settings: Settings, gnn: NetworkSettings, cohort: PlannedCohort, root: Path) -> bool:
    """Whether the network is trained in this run."""
    named = gnn.pretrained
    if settings.train is True and named:
        raise InputError(
            "config keys train and gnn.pretrained",
            f"a model is to be trained, but {named} is named",
            "set train: false, or gnn.pretrained to null",
        )
    trained = cohort.is_asked(settings.train, root) and not named
    if gnn.start and not trained:
        raise InputError("config key gnn.start", "nothing is trained in this run", "set train: true")
    return trained


def _model_files(key: str, name: str | None, root: Path) -> tuple[str, ...]:
    """Find the model that a key of section ``gnn`` names, if any; one that is not there is refused."""
    if not name:
        return ()
    path = find_file(name, root)
    if not path.is_file():
        hint = "name a model.pt, from here or from the project's folder"
        raise InputError(f"config key gnn.{key}", f"there is no file {name}", hint)
    return (near(path),)


@dataclass(frozen=True)
class SegmenterPlan:
    """What makes the masks of rows that have an image alone.

    Attributes
    ----------
    name : str or None
        As the configuration names it; None where nothing does.
    weights : tuple of str
        Its file; empty for one that is installed beside.
    labels : str
        Label values of its masks, as the sheet's column ``label`` has them.
    code : tuple of str
        Path of its network's class; empty for one that is installed beside.
    """

    name: str | None
    weights: tuple[str, ...] = ()
    labels: str = ""
    code: tuple[str, ...] = ()

    @classmethod
    def choose(cls, settings: Settings, cohort: PlannedCohort, root: Path) -> SegmenterPlan:
        """Choose the segmenter; a network's name means the weights that the sheet's rows of role train give.

        Raises
        ------
        InputError
            Nothing is there to train the network on, or no such network and file.
        """
        name, known, whole = settings.segmenter, networks(), settings.as_config()
        if name is None:
            return cls(None)
        if is_installed_segmenter(name):
            return cls(name, labels="1")
        if name in known:
            if not cohort.training:
                problem = f"{name} is to be trained, and {cohort.sheet.name} has no row of role train"
                hint = "add such rows, or name a file of workflow/models/segmenters"
                raise InputError("config key segmenter", problem, hint)
            weights, labels = f"results/segmenters/{name}/model.pt", whole["segmentation"]["labels"]
            return cls(name, (weights,), _joined(labels or [1]), (known[name].build,))
        path = find_file(name, root)
        if not path.is_file():
            problem = f"there is neither a network nor a file {name}"
            raise InputError("config key segmenter", problem, nearest(name, [*known, *INSTALLED_SEGMENTERS]))
        says = read_segmenter_plan(near(path))
        code = (known[says["network"]].build,) if says["network"] in known else ()
        return cls(name, (near(path),), _joined(says["labels"]), code)

    @property
    def is_installed(self) -> bool:
        """Whether it is a program that is installed beside."""
        return self.name is not None and is_installed_segmenter(self.name)


def _joined(labels: Iterable[int]) -> str:
    return ",".join(map(str, labels))
