from typing import Any

from torch import Tensor, nn

class MessagePassing(nn.Module):
    def __init__(self, aggr: str = "sum", **settings: Any) -> None: ...
    def propagate(self, edge_index: Tensor, size: tuple[int, int] | None = None, **values: Any) -> Tensor: ...
