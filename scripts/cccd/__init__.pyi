from cccd.api import *  # noqa: F403 - the names of its __all__
from cccd_junctions.maps import order as order
from cccd_labels.whole_map import reconstruct_labels as reconstruct_labels
from cccd_meshes.smooth import smooth_mesh as smooth_mesh
from cccd_workflow.comparison import compare as compare

__version__: str
