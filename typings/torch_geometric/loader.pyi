from collections.abc import Iterator
from typing import Any, Generic, TypeVar

from torch.utils.data import Dataset
from torch_geometric.data import Data

_D = TypeVar("_D", bound=Data)

class DataLoader(Generic[_D]):
    def __init__(
        self,
        dataset: Dataset[_D],
        batch_size: int = 1,
        shuffle: bool = False,
        *,
        drop_last: bool = False,
        num_workers: int = 0,
        **settings: Any,
    ) -> None: ...
    def __iter__(self) -> Iterator[_D]: ...
    def __len__(self) -> int: ...
