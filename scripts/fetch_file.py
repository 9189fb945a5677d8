"""Fetch a file that the sheet names by an address."""

from cccd.store import atomic_path
from cccd_workflow.job import job
from cccd_workflow.remote import RemoteFile, fetch

with job(snakemake.log[0], "download", snakemake.input, snakemake.output) as logger:
    with atomic_path(snakemake.output[0]) as path:
        digest = fetch(RemoteFile(snakemake.params.address, snakemake.params.sha256), path)
    logger.info("%s: SHA-256 %s", snakemake.params.address, digest)
