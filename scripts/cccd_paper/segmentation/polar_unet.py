"""Polar U-Net: a U-Net on slices in polar coordinates about a centre that another U-Net predicts.

Benčević, Galić, Habijan and Babin, "Training on polar image transformations improves biomedical image
segmentation", IEEE Access 9 (2021).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from cccd_paper.segmentation.slices import conv_block, restack, slices_of


class UNet(nn.Module):
    """The U-Net of both steps: four poolings, twice the channels after each.

    Parameters
    ----------
    classes : int
        Labels, the background among them.
    width : int
        Channels of the first level.
    """

    def __init__(self, classes: int, width: int) -> None:
        super().__init__()
        widths = [width * 2**level for level in range(5)]
        inputs = [3, *widths[:-1]]
        self.down = nn.ModuleList(conv_block(*pair, bias=False) for pair in zip(inputs, widths, strict=True))
        levels = list(zip(widths[1:], widths[:-1], strict=True))[::-1]
        self.widen = nn.ModuleList(nn.ConvTranspose2d(deep, fine, 2, stride=2) for deep, fine in levels)
        self.up = nn.ModuleList(conv_block(2 * fine, fine, bias=False) for _, fine in levels)
        self.head = nn.Conv2d(width, classes, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Map slices (n, 3, h, w), h and w multiples of 16, to logits (n, classes, h, w)."""
        skips: list[Tensor] = []
        for block in self.down:
            x = block(functional.max_pool2d(x, 2) if skips else x)
            skips.append(x)
        for widen, block, skip in zip(self.widen, self.up, skips[-2::-1], strict=True):
            x = block(torch.cat([widen(x), skip], dim=1))
        return self.head(x)


class PolarUNet(nn.Module):
    """Two U-Nets: one on the slices as they are finds the centre, one about the centre finds the labels.

    Parameters
    ----------
    classes : int
        Labels, the background among them.
    width : int
        Channels of the first level of either.
    jitter : float
        Standard deviation of the true centre's displacement in training, in pixels.
    """

    def __init__(self, classes: int, width: int, jitter: float = 2.0) -> None:
        super().__init__()
        self.centre = UNet(classes, width)
        self.polar = UNet(classes, width)
        self.jitter = jitter

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return (logits, labels) of each step; the second one's are polar, about the true centre."""
        slices, truth = slices_of(volume), labels.permute(0, 4, 1, 2, 3).flatten(0, 1)
        present = (truth > 0).any(dim=(1, 2, 3)) if bool((truth > 0).any()) else truth[:, 0, 0, 0] >= 0
        centres = _centroids((truth > 0).float(), len(volume))
        centres = centres + self.jitter * torch.randn_like(centres)
        polar = to_polar(slices, centres)[present]
        target = to_polar(truth.float(), centres, mode="nearest")[present].long()
        return [(self.centre(slices), truth), (self.polar(polar), target)]

    def forward(self, volume: Tensor) -> Tensor:
        """Map volumes (b, 1, h, w, d) to logits (b, classes, h, w, d), h and w multiples of 16."""
        slices = slices_of(volume)
        first = self.centre(slices).float()
        inside = first.softmax(dim=1)[:, :1] < 0.5
        centres = _centroids(inside.float(), len(volume))
        logits = from_polar(self.polar(to_polar(slices, centres)), centres, slices.shape[2:])
        # the second network knows slices with an organ: where the first finds none, there is none
        present = inside.any(dim=(2, 3), keepdim=True)
        return restack(torch.where(present, logits.float(), first), len(volume))


def _centroids(inside: Tensor, batch: int) -> Tensor:
    """Centroids (n, 2) of the slices' regions in pixels; a slice without one has its volume's."""
    height, width = inside.shape[2:]
    rows = torch.arange(height, dtype=inside.dtype, device=inside.device)
    columns = torch.arange(width, dtype=inside.dtype, device=inside.device)
    mass = inside.sum(dim=(1, 2, 3))
    first = torch.stack([(inside.sum(3)[:, 0] * rows).sum(1), (inside.sum(2)[:, 0] * columns).sum(1)], dim=1)
    whole_mass = mass.unflatten(0, (batch, -1)).sum(1)
    whole = first.unflatten(0, (batch, -1)).sum(1) / whole_mass.clamp(min=1)[:, None]
    middle = torch.tensor([(height - 1) / 2, (width - 1) / 2], dtype=inside.dtype, device=inside.device)
    whole = torch.where(whole_mass[:, None] > 0, whole, middle)
    whole = whole.repeat_interleave(len(inside) // batch, dim=0)
    return torch.where(mass[:, None] > 0, first / mass.clamp(min=1)[:, None], whole)


def _reach(height: int, width: int) -> float:
    """Largest radius that is looked at, in pixels: half the diagonal, as in the authors' repository."""
    return 0.5 * math.hypot(height, width)


def to_polar(slices: Tensor, centres: Tensor, mode: str = "bilinear") -> Tensor:
    """Resample slices to polar coordinates: rows are radii, columns angles.

    Parameters
    ----------
    slices : (n, c, h, w) tensor
    centres : (n, 2) tensor
        Row and column of each slice's centre, in pixels.
    mode : str
        ``bilinear`` or ``nearest``.

    Returns
    -------
    (n, c, h, w) tensor
        As many radii as rows, from 0 to half the diagonal; as many angles as columns, once around.
    """
    height, width = slices.shape[2:]
    radius = torch.linspace(0, _reach(height, width), height, device=slices.device)[:, None]
    angle = torch.arange(width, device=slices.device) * (2 * math.pi / width)
    rows = centres[:, 0, None, None] + radius * torch.sin(angle)
    columns = centres[:, 1, None, None] + radius * torch.cos(angle)
    return _sample(slices, rows, columns, mode)


def from_polar(polar: Tensor, centres: Tensor, shape: torch.Size) -> Tensor:
    """Resample what `to_polar` gave back to slices of a shape (h, w).

    Examples
    --------
    >>> row, column = torch.meshgrid(torch.arange(32.0), torch.arange(32.0), indexing="ij")
    >>> blob = torch.exp(-((row - 14) ** 2 + (column - 17) ** 2) / 50)[None, None]
    >>> centre = torch.tensor([[15.0, 16.0]])
    >>> bool((from_polar(to_polar(blob, centre), centre, blob.shape[2:]) - blob).abs().max() < 0.06)
    True
    """
    height, width = shape
    rows = torch.arange(height, device=polar.device)[:, None] - centres[:, 0, None, None]
    columns = torch.arange(width, device=polar.device) - centres[:, 1, None, None]
    radius = torch.hypot(rows, columns) * ((polar.shape[2] - 1) / _reach(height, width))
    angle = torch.atan2(rows, columns) % (2 * math.pi) * (polar.shape[3] / (2 * math.pi))
    around = torch.cat([polar, polar[..., :1]], dim=3)  # from the last angle to the first
    return _sample(around, radius, angle, "bilinear")


def _sample(images: Tensor, rows: Tensor, columns: Tensor, mode: str) -> Tensor:
    """Values of images (n, c, h, w) at rows and columns (n, a, b) in pixels; outside, those at the border."""
    height, width = images.shape[2:]
    grid = torch.stack([2 * columns / (width - 1) - 1, 2 * rows / (height - 1) - 1], dim=-1)
    sampled = functional.grid_sample(
        images.float(), grid.float(), mode=mode, padding_mode="border", align_corners=True
    )
    return sampled.to(images.dtype)
