from cccd.api import *  # noqa: F403 - the names of its __all__

__version__: str
