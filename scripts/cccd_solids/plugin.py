"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Format, Reader

_SOLIDS = ("cccd_solids.files.write", "cad", "solids")

READERS = dict.fromkeys(
    (".step", ".stp", ".iges", ".igs", ".brep"), Reader("cccd_solids.kernel.read_solid_mesh", holds="mesh")
)

WRITERS = {
    "brep": Format("closed solids, in OpenCASCADE's own format", *_SOLIDS),
    "iges": Format("closed solids (IGES 5.3)", *_SOLIDS),
    "step": Format("closed solids (STEP AP242)", *_SOLIDS),
    "usd": Format("the spline itself: control meshes and creases", "cccd_solids.usd.write", "usd"),
    "usda": Format("the same in text", "cccd_solids.usd.write", "usd"),
    "usdc": Format("the same in binary", "cccd_solids.usd.write", "usd"),
}
