import shutil
from types import SimpleNamespace

from support.refusals import refusal

from cccd_workflow.disk_space import check_room, least_bytes


def test_room_is_asked_of_the_disk_and_replaced_files_count_once(tmp_path, monkeypatch):
    results = tmp_path / "results"  # not there yet: its disk is that of the folder above
    files = [results / f"c{n}" / "organ" / "surface.ply" for n in range(3)]
    needed = least_bytes(files)
    assert needed == 3 * least_bytes(files[:1])
    asked = []
    free = SimpleNamespace(free=needed)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: asked.append(folder) or free)
    check_room(results, files)
    assert asked == [tmp_path]
    free.free = needed - 1
    assert "free, and this run writes" in refusal(check_room, results, files)
    files[0].parent.mkdir(parents=True)
    files[0].write_bytes(bytes(1000))
    check_room(results, files)
