from cccd.api import *  # noqa: F403 - the names of its __all__
from cccd_labels.whole_map import reconstruct_labels as reconstruct_labels

__version__: str
