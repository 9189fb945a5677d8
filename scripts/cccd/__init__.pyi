from cccd.api import *  # noqa: F403 - the names of its __all__
from cccd_labels.whole_map import reconstruct_labels as reconstruct_labels
from cccd_workflow.comparison import compare as compare

__version__: str
