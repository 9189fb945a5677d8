"""Scans that are not here, from a server of this machine: whole and as promised, or not at all."""

import hashlib
import http.server
import threading

import pytest
from support.refusals import refusal

from cccd_workflow.remote import RemoteFile, fetch, is_remote, read_address

BYTES = bytes(range(256)) * 5000
SHA256 = hashlib.sha256(BYTES).hexdigest()
KEY, SECRET = "AKIAPUBLICNAME", "very-secret-key"


class Server(http.server.BaseHTTPRequestHandler):
    """Gives the same bytes under every name; breaks off half way under some."""

    def do_GET(self):
        if "missing" in self.path:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(BYTES)))
        self.end_headers()
        self.wfile.write(BYTES[: len(BYTES) // 2] if "half" in self.path else BYTES)

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def server():
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_port}"
        running.shutdown()


def test_a_whole_file(server, tmp_path):
    remote = read_address(f"{server}/a%20b/m.nii.gz#sha256={SHA256.upper()}", "row")
    assert fetch(remote, tmp_path / "m") == SHA256
    assert (tmp_path / "m").read_bytes() == BYTES


@pytest.mark.parametrize(
    ("name", "sha256", "words"),
    [
        ("half.nii", "", f"only {len(BYTES) // 2} of {len(BYTES)} bytes arrived"),
        ("missing.nii", "", "the server answers 404"),
        ("m.nii", "0" * 64, f"its SHA-256 is {SHA256}"),
    ],
)
def test_what_is_refused(server, name, sha256, words, tmp_path):
    assert words in refusal(fetch, RemoteFile(f"{server}/{name}", sha256), tmp_path / "m")


def test_nobody_there(tmp_path):
    assert "cannot be fetched" in refusal(fetch, RemoteFile("http://127.0.0.1:9/m.nii", ""), tmp_path / "m")


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("https://anna:word@host/m.nii", "contains credentials"),
        ("https://host/m.nii?X-Amz-Signature=abc&X-Amz-Credential=x", "contains credentials"),
        ("https://host/m.nii?access_token=abc", "contains credentials"),
        ("https://host/folder/", "does not name the file of a volume"),
        ("s3:///m.nii", "does not name the file of a volume"),
        ("http://host/m.nii", "does not prove where a file"),
        ("https://host/m.nii#sha256=12", "ends with an invalid checksum"),
    ],
)
def test_addresses_that_are_refused(address, words):
    assert is_remote(address)
    line = refusal(read_address, address, "cohort.tsv row 2")
    assert "row 2: " in line
    assert words in line
    assert "word@" not in line
    assert "abc" not in line


def test_a_file_has_one_place_by_its_address_and_checksum():
    one, two = (read_address(f"https://host/../x%20y.nii#sha256={digit * 64}", "row") for digit in "01")
    assert one.local != two.local
    assert one.local.name == "x_y.nii"
    assert one.local.parts[0] == "downloads"
    assert len(one.local.parts) == 3


def test_objects_of_s3_by_the_credentials_of_the_environment(tmp_path, monkeypatch):
    boto3 = pytest.importorskip("boto3")
    moto = pytest.importorskip("moto.server")
    running = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    try:
        host, port = running.get_host_and_port()
        for name, value in {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            monkeypatch.setenv(name, value)
        client = boto3.client("s3")
        client.create_bucket(Bucket="scans")
        client.put_object(Bucket="scans", Key="a b/m.nii.gz", Body=BYTES)
        remote = read_address("s3://scans/a%20b/m.nii.gz", "row")
        assert fetch(remote, tmp_path / "m") == SHA256
        assert (tmp_path / "m").read_bytes() == BYTES
        line = refusal(fetch, read_address("s3://scans/other.nii", "row"), tmp_path / "n")
        assert "the server answers NoSuchKey" in line
        assert SECRET not in line
        assert KEY not in line
    finally:
        running.stop()
