"""Scans that are not here: what the sheet names by ``https://`` or ``s3://`` is fetched whole or not at all.

Credentials come from the environment alone (``AWS_ACCESS_KEY_ID`` and its kin for s3; ``AWS_ENDPOINT_URL``
names another server than Amazon's). An address that carries some is refused: addresses stand in logs.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import http.client
import re
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cccd.errors import InputError
from cccd.extras import needing

#: Seconds that a server may be silent.
PATIENCE_S = 60
_CHUNK = 1 << 20
#: Parts of a query that let whoever reads them in.
_SECRET = re.compile(r"signature|credential|token|secret|password|passwd|apikey|api_key|^sig$", re.IGNORECASE)
_SUFFIXES = (".nii", ".nii.gz", ".mgz", ".nrrd", ".mha")


@dataclass(frozen=True)
class RemoteFile:
    """A file elsewhere.

    Attributes
    ----------
    address : str
        Without the checksum.
    sha256 : str
        Of its bytes, in hexadecimal; empty where the sheet gives none.
    """

    address: str
    sha256: str

    @property
    def local(self) -> Path:
        """Where it goes, from the folder of the run: equal addresses and checksums share one file."""
        key = hashlib.sha256(f"{self.address}#{self.sha256}".encode()).hexdigest()[:16]
        name = urllib.parse.unquote(urllib.parse.urlsplit(self.address).path.rpartition("/")[2])
        return Path("downloads") / key / re.sub(r"[^A-Za-z0-9._-]", "_", name)


def is_remote(name: str) -> bool:
    """Whether a field of the sheet is an address.

    >>> is_remote("s3://scans/anna.nii.gz"), is_remote("scans/anna.nii.gz")
    (True, False)
    """
    return name.lower().startswith(("https://", "http://", "s3://"))


def read_address(text: str, location: str) -> RemoteFile:
    """Read an address, with ``#sha256=...`` behind it where the file must be a certain one.

    Parameters
    ----------
    text : str
        ``https://host/path`` or ``s3://bucket/key``; plain ``http://`` with a checksum only.
    location : str
        What messages name: the sheet's row.

    Raises
    ------
    InputError
        Credentials in the address, no file of a volume, a malformed checksum, or ``http://`` without one.

    Examples
    --------
    >>> read_address("s3://scans/anna.nii.gz", "cohort.tsv row 2").address
    's3://scans/anna.nii.gz'
    """
    parts = urllib.parse.urlsplit(text)
    queries = [key for key, _ in urllib.parse.parse_qsl(parts.query, keep_blank_values=True)]
    if parts.username or parts.password or any(map(_SECRET.search, queries)):
        raise InputError(location, "an address contains credentials", "put them into environment variables")
    if not parts.netloc or not parts.path.lower().endswith(_SUFFIXES):
        raise InputError(
            location,
            "an address does not name the file of a volume",
            f"give one that ends with {', '.join(_SUFFIXES)}",
        )
    checksum = parts.fragment.removeprefix("sha256=").lower()
    if parts.fragment and not re.fullmatch("[0-9a-f]{64}", checksum):
        raise InputError(
            location, "an address ends with an invalid checksum", "write #sha256= and 64 digits, or nothing"
        )
    if parts.scheme.lower() == "http" and not checksum:
        raise InputError(
            location,
            "http:// does not prove where a file comes from",
            "use https://, or add #sha256= and its checksum",
        )
    return RemoteFile(urllib.parse.urlunsplit(parts._replace(fragment="")), checksum)


def fetch(remote: RemoteFile, path: Path) -> str:
    """Fetch a file to a temporary path, and give its SHA-256; the caller renames it.

    Parameters
    ----------
    remote : RemoteFile
        Which file.
    path : path
        Where its bytes go.

    Raises
    ------
    InputError
        The server refuses or is silent, the transfer broke off, or the checksum is another. What it says
        holds no credentials.
    """
    digest, length = hashlib.sha256(), 0
    with _opened(remote.address) as (stream, promised), path.open("wb") as file:
        while chunk := stream.read(_CHUNK):
            file.write(chunk)
            digest.update(chunk)
            length += len(chunk)
    if promised is not None and length != promised:
        raise _failed(remote.address, f"only {length} of {promised} bytes arrived")
    if remote.sha256 and digest.hexdigest() != remote.sha256:
        problem = f"its SHA-256 is {digest.hexdigest()}, and the sheet says {remote.sha256}"
        raise InputError(remote.address, problem, "correct the sheet, or ask who changed the file")
    return digest.hexdigest()


@contextlib.contextmanager
def _opened(address: str) -> Iterator[tuple[Any, int | None]]:
    """Open an address: its bytes, and how many the server promises."""
    if address.lower().startswith("s3://"):
        with _opened_s3(address) as found:
            yield found
        return
    try:
        with urllib.request.urlopen(address, timeout=PATIENCE_S) as answer:
            promised = answer.headers.get("Content-Length")
            yield answer, None if promised is None else int(promised)
    except urllib.error.HTTPError as error:
        raise _failed(address, f"the server answers {error.code}") from None
    except (OSError, http.client.HTTPException) as error:
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:
            raise  # of the disk that is written to
        raise _failed(address, str(getattr(error, "reason", "")) or type(error).__name__) from None


@contextlib.contextmanager
def _opened_s3(address: str) -> Iterator[tuple[Any, int]]:
    """Open an object of S3, by the credentials of the environment; without any, as anybody may."""
    with needing(address, "s3"):
        import boto3
        from botocore import UNSIGNED
        from botocore.config import Config
        from botocore.exceptions import BotoCoreError, ClientError
    parts = urllib.parse.urlsplit(address)
    session = boto3.Session()
    config = Config(connect_timeout=PATIENCE_S, read_timeout=PATIENCE_S)
    if session.get_credentials() is None:
        config = config.merge(Config(signature_version=UNSIGNED))
    try:
        client = session.client("s3", config=config)
        answer = client.get_object(Bucket=parts.netloc, Key=urllib.parse.unquote(parts.path.lstrip("/")))
        with contextlib.closing(answer["Body"]) as body:
            yield body, int(answer["ContentLength"])
    except ClientError as error:
        raise _failed(address, f"the server answers {error.response['Error']['Code']}") from None
    except BotoCoreError as error:
        raise _failed(address, type(error).__name__) from None


def _failed(address: str, reason: str) -> InputError:
    problem = f"it cannot be fetched ({reason})"
    return InputError(address, problem, "check address, network and credentials, and run again")
