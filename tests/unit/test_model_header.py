import hashlib
from pathlib import Path

import pytest
from support import ROOT
from support.refusals import refusal

from cccd import bands
from cccd.errors import InputError
from cccd.surface import learned_distance
from cccd_junctions import reranking
from cccd_junctions.checkpoint import load_model, save_model
from cccd_junctions.network import JunctionNetwork
from cccd_networks.model_header import check_model, check_start, read_header
from cccd_networks.settings import NetworkSettings
from cccd_paper.junctions.network import PaperNetwork

FITTING = {"width": 8, "message_layers": 2}
MODELS = ROOT / "workflow" / "models"


@pytest.fixture
def files(tmp_path):
    """A file of each network."""
    networks = {"ours": JunctionNetwork(**NetworkSettings(**FITTING).sizes), "paper": PaperNetwork(4, 0.5)}
    for name, network in networks.items():
        save_model(tmp_path / f"{name}.pt", name, network.sizes, network.state_dict(), 0)
    return tmp_path


@pytest.mark.parametrize("name", ["ours", "paper"])
def test_a_file_says_whose_it_is_and_loads(files, name):
    header = read_header(files / f"{name}.pt")
    assert header.network == name
    assert load_model(files / f"{name}.pt").sizes == header.sizes


@pytest.mark.parametrize(("name", "other"), [("ours", "paper"), ("paper", "ours")])
def test_the_other_networks_file_is_refused_in_one_line(files, name, other):
    line = refusal(check_model, files / f"{name}.pt", other)
    assert f"{name}.pt" in line
    assert f"set gnn.network to {name}" in line


@pytest.mark.parametrize(
    ("file", "digest"),
    [
        (learned_distance.WEIGHTS, learned_distance.WEIGHTS_SHA256),
        (reranking.WEIGHTS, reranking.WEIGHTS_SHA256),
        (bands.SHIPPED, bands.SHIPPED_SHA256),
    ],
)
def test_a_shipped_file_is_the_one_that_its_hash_names(file, digest):
    assert hashlib.sha256(Path(file).read_bytes()).hexdigest() == digest


def test_the_shipped_files_are_read():
    assert read_header(MODELS / "junctions.pt").network == "ours"
    assert read_header(MODELS / "paper.pt").network == "paper"
    assert isinstance(load_model(MODELS / "paper.pt"), PaperNetwork)


@pytest.mark.parametrize(("key", "other"), [("width", 16), ("message_layers", 1)])
def test_a_start_that_would_lose_weights_is_refused(files, key, other):
    check_start(files / "ours.pt", NetworkSettings(**FITTING))
    check_start(files / "ours.pt", NetworkSettings(**FITTING | {"message_layers": 3}))
    with pytest.raises(InputError, match=f"set gnn.{key}"):
        check_start(files / "ours.pt", NetworkSettings(**FITTING | {key: other}))
    assert "gnn.network" in refusal(check_start, files / "ours.pt", NetworkSettings(network="paper"))


def test_a_start_of_widths_that_cannot_be_set_is_refused(tmp_path):
    network = JunctionNetwork(width=8, link_width=8, message_layers=2)
    save_model(tmp_path / "old.pt", "ours", network.sizes, network.state_dict(), 0)
    with pytest.raises(InputError, match=r"its link_width is not 6.*set gnn\.start to null"):
        check_start(tmp_path / "old.pt", NetworkSettings(**FITTING))
