"""A row whose mask lies on a server: fetched once, checked, and never again while the sheet says the same."""

import functools
import hashlib
import http.server
import threading

import nibabel
import numpy as np
import pytest

TARGET = "results/a/ball/structure.h5"


@pytest.fixture
def server(tmp_path):
    folder = tmp_path / "served"
    folder.mkdir()
    grid = np.indices((20, 20, 12)) - np.array([10, 10, 6]).reshape(3, 1, 1, 1)
    mask = (np.hypot.reduce(grid) < 6).astype(np.uint8)
    nibabel.save(nibabel.Nifti1Image(mask, np.eye(4)), folder / "mask.nii.gz")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        asked = 0

        def log_message(self, *_):
            Quiet.asked += 1

    handler = functools.partial(Quiet, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        running.folder, running.count = folder, lambda: Quiet.asked
        yield running
        running.shutdown()


def test_a_mask_on_a_server(fresh_project, server):
    checksum = hashlib.sha256((server.folder / "mask.nii.gz").read_bytes()).hexdigest()
    address = f"http://127.0.0.1:{server.server_port}/mask.nii.gz#sha256={checksum}"
    (fresh_project.folder / "tiny.tsv").write_text(f"case\torgan\tmask\na\tball\t{address}\n")
    assert fresh_project.planned(TARGET) == {"fetch_file": 1, "import_structure": 1}
    fresh_project.snakemake(TARGET)
    asked = server.count()
    assert fresh_project.planned(TARGET) == {}
    assert server.count() == asked
