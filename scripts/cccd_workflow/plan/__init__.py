"""What the workflow's rules need to know of a run: its structures, networks, files, settings, resources.

`cccd_workflow.plan.plan.Plan` is made each time the workflow starts, also for a single job of a cluster; so
nothing here imports torch, nor a reader of scans unless the sheet needs one. Nothing here knows Snakemake.
"""
