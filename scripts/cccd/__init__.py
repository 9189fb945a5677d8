"""Corner detection and curve reconstruction: smooth B-spline surfaces from stacks of slices.

The library behind the workflow. It never sees ``snakemake``: arrays and small dataclasses go in and
come out. Imports run one way: geometry -> volumes -> boundary -> chaincode and tracing -> junctions ->
curves -> surface -> comparisons -> report, with ``errors``, ``tolerances``, ``settings``, ``containers``,
``metrics`` and ``store`` underneath.
"""

__version__ = "0.2.0"
