"""A U-Net (Ronneberger et al., MICCAI 2015) as kernels over planes of numbers, in single precision.

Of a crop of N × N cells in L layers, blocks of 2 × 2 become channels (Shi et al., CVPR 2016), so that the
finest of the four levels has side N/2. At each level two 3 × 3 convolutions, then the largest of 2 × 2 goes
a level down. On the way up, a 1 × 1 convolution of the coarser level, each number repeated 2 × 2 times, is
added to the finer one, and a 3 × 3 convolution follows. A last 1 × 1 convolution gives four logits a block
for each layer. The 3 × 3 convolutions end in max(0, ·); beyond the border is 0.

A plane of a level with side s is (s + 2)² numbers, row by row with a border of zeros. A convolution runs over
all rows as one: its inner loop is long and nothing in it is summed up across the loop, so that a compiler
makes vectors of it without changing the order of additions. The same belief gives the same bits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel

LEVELS = 4
BLOCK = 4
"""Cells of a block in one layer."""


class Form(NamedTuple):
    """What a network sees and says, and how large it is."""

    cells: int
    """N, cells of a crop along x and along y."""
    layers: int
    """L, layers of cells."""
    cell_m: float
    """Edge of a cell."""
    widths: tuple[int, int, int, int]
    """Channels of each level, the finest first."""

    @property
    def channels(self) -> int:
        """What is told of a crop: shares measured solid and free in each layer, and what is outside."""
        return 2 * self.layers + 1

    @property
    def side(self) -> int:
        """Side of the finest level."""
        return self.cells // 2


class Layer(NamedTuple):
    """A convolution from I to O channels."""

    weights: np.ndarray
    """(O, I, K) float32, with K = 9 in the order of rows, or 1."""
    bias: np.ndarray
    """(O,) float32."""


class Network(NamedTuple):
    """The layers of a U-Net."""

    first: tuple[Layer, ...]
    """Of each level, its first convolution."""
    second: tuple[Layer, ...]
    """Of each level, its second one."""
    lift: tuple[Layer, ...]
    """Of each level but the coarsest, the 1 × 1 convolution of the level below it."""
    merge: tuple[Layer, ...]
    """Of each level but the coarsest, the convolution on the way up."""
    head: Layer


def layer_shapes(form: Form) -> dict[str, tuple[int, int, int]]:
    """Return (O, I, K) of each layer, by its name: the field of Network, and its number in it."""
    widths, inputs = form.widths, (BLOCK * form.channels, *form.widths[:-1])
    shapes = {f"first.{level}": (widths[level], inputs[level], 9) for level in range(LEVELS)}
    shapes |= {f"second.{level}": (widths[level], widths[level], 9) for level in range(LEVELS)}
    shapes |= {f"lift.{level}": (widths[level], widths[level + 1], 1) for level in range(LEVELS - 1)}
    shapes |= {f"merge.{level}": (widths[level], widths[level], 9) for level in range(LEVELS - 1)}
    return shapes | {"head": (BLOCK * form.layers, widths[0], 1)}


class Planes(NamedTuple):
    """Scratch memory: nothing in it is read before it is written, but for the zeros around planes."""

    blocks: np.ndarray
    """(4·(2·L + 1), P) float32, the crop as channels."""
    below: tuple[np.ndarray, ...]
    """Of each level but the finest, its input (I, P)."""
    inner: tuple[np.ndarray, ...]
    """Of each level, (O, P) after its first convolution; on the way up, the sum."""
    outer: tuple[np.ndarray, ...]
    """Of each level, (O, P) after its last one."""
    lifted: tuple[np.ndarray, ...]
    """Of each level but the coarsest, (O, P of the level below) on the way up."""
    logits: np.ndarray
    """(4·L, P) float32."""


def new_planes(form: Form) -> Planes:
    """Return scratch memory for one crop."""
    sizes = [((form.side >> level) + 2) ** 2 for level in range(LEVELS)]
    each, upper, widths = range(LEVELS), range(LEVELS - 1), form.widths
    return Planes(
        blocks=np.zeros((BLOCK * form.channels, sizes[0]), np.float32),
        below=tuple(np.zeros((widths[level], sizes[level + 1]), np.float32) for level in upper),
        inner=tuple(np.zeros((widths[level], sizes[level]), np.float32) for level in each),
        outer=tuple(np.zeros((widths[level], sizes[level]), np.float32) for level in each),
        lifted=tuple(np.zeros((widths[level], sizes[level + 1]), np.float32) for level in upper),
        logits=np.zeros((BLOCK * form.layers, sizes[0]), np.float32),
    )


@lean_kernel
def infer(network, planes, cells):
    """Fill in the logits of a crop.

    Args:
        network: Network.
        planes: Planes; changed in place.
        cells: (2·L + 1, N, N) float32.
    """
    finest = cells.shape[1] // 2
    fill_blocks(cells, planes.blocks)
    convolve(planes.blocks, network.first[0], finest, planes.inner[0])
    convolve(planes.inner[0], network.second[0], finest, planes.outer[0])
    for level in range(1, LEVELS):
        side = finest >> level
        pool_largest(planes.outer[level - 1], side, planes.below[level - 1])
        convolve(planes.below[level - 1], network.first[level], side, planes.inner[level])
        convolve(planes.inner[level], network.second[level], side, planes.outer[level])
    for level in range(LEVELS - 2, -1, -1):
        side = finest >> level
        mix(planes.outer[level + 1], network.lift[level], planes.lifted[level])
        add_repeated(planes.lifted[level], planes.outer[level], side, planes.inner[level])
        convolve(planes.inner[level], network.merge[level], side, planes.outer[level])
    mix(planes.outer[0], network.head, planes.logits)


@lean_kernel
def fill_blocks(cells, blocks):
    """Fill in the planes (4·C, P) of blocks of 2 × 2 cells, from cells (C, N, N)."""
    side = cells.shape[1] // 2
    for channel in range(len(cells)):
        for part in range(BLOCK):
            plane = blocks[BLOCK * channel + part]
            for i in range(side):
                row = plane[(i + 1) * (side + 2) + 1 : (i + 2) * (side + 2) - 1]
                source = cells[channel, 2 * i + part // 2]
                for j in range(side):
                    row[j] = source[2 * j + part % 2]


@lean_kernel
def convolve(image, layer, side, out):
    """Fill in max(0, 3 × 3 convolution), planes (O, P) from (I, P)."""
    weights, bias = layer
    stride = side + 2
    count = side * stride - 2
    for o in range(len(out)):
        row = out[o][stride + 1 : stride + 1 + count]
        for p in range(count):
            row[p] = bias[o]
        for i in range(len(image)):
            w = weights[o, i]
            w0, w1, w2, w3, w4, w5, w6, w7, w8 = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7], w[8]
            above = image[i][: count + 2]
            here = image[i][stride : stride + count + 2]
            below = image[i][2 * stride : 2 * stride + count + 2]
            for p in range(count):
                upper = (w0 * above[p] + w1 * above[p + 1]) + (w2 * above[p + 2] + w3 * here[p])
                lower = (w4 * here[p + 1] + w5 * here[p + 2]) + (w6 * below[p] + w7 * below[p + 1])
                row[p] += (upper + lower) + w8 * below[p + 2]
        for p in range(count):
            row[p] = max(row[p], np.float32(0.0))
        for y in range(side):  # between the rows
            out[o, (y + 1) * stride] = 0.0
            out[o, (y + 2) * stride - 1] = 0.0


@lean_kernel
def mix(image, layer, out):
    """Fill in a 1 × 1 convolution, planes (O, P) from (I, P), borders included."""
    weights, bias = layer
    for o in range(len(out)):
        row = out[o]
        for p in range(len(row)):
            row[p] = bias[o]
        for i in range(len(image)):
            w, plane = weights[o, i, 0], image[i]
            for p in range(len(row)):
                row[p] += w * plane[p]


@lean_kernel
def pool_largest(image, side, out):
    """Fill in the largest of each 2 × 2 numbers, planes (C, P) of a level from those of the finer one."""
    stride, finer = side + 2, 2 * side + 2
    for c in range(len(out)):
        plane = image[c]
        for y in range(side):
            row = out[c][(y + 1) * stride + 1 : (y + 2) * stride - 1]
            above = plane[(2 * y + 1) * finer + 1 : (2 * y + 2) * finer - 1]
            below = plane[(2 * y + 2) * finer + 1 : (2 * y + 3) * finer - 1]
            for x in range(side):
                upper = max(above[2 * x], above[2 * x + 1])
                row[x] = max(upper, max(below[2 * x], below[2 * x + 1]))


@lean_kernel
def add_repeated(coarse, fine, side, out):
    """Fill in a level's planes plus each number of the coarser level, repeated 2 × 2 times."""
    stride, half = side + 2, side // 2 + 2
    for c in range(len(out)):
        for y in range(side):
            begin, source = (y + 1) * stride + 1, (y // 2 + 1) * half + 1
            row, own = out[c][begin : begin + side], fine[c][begin : begin + side]
            add = coarse[c][source : source + side // 2]
            for x in range(side):
                row[x] = own[x] + add[x // 2]


@lean_kernel
def fill_unmeasured(planes, solid):
    """Fill in the probability to be solid wherever (L, N, N) `solid` is below 0: what is measured stays."""
    layers, cells, _ = solid.shape
    stride = cells // 2 + 2
    for layer in range(layers):
        for i in range(cells):
            for j in range(cells):
                if solid[layer, i, j] < 0.0:
                    part = BLOCK * layer + 2 * (i % 2) + j % 2
                    logit = planes.logits[part, (i // 2 + 1) * stride + j // 2 + 1]
                    solid[layer, i, j] = 1.0 / (1.0 + math.exp(-np.float64(logit)))
