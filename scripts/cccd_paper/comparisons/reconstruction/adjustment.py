"""Boundary adjustment: from a graph on Delaunay edges to closed boundaries, by inflating and sculpting.

The step that Connect2D and SIG-Connect2D share: S. Ohrhallinger, S. Mudur, An efficient algorithm for
determining an aesthetic shape connecting unorganized 2D points, Computer Graphics Forum 32 (2013) 72-88.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit
from cccd_paper.comparisons.reconstruction.delaunay import Triangulation


def adjust_boundary(mesh: Triangulation, in_graph: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """Turn a graph of Delaunay edges into boundaries that pass each point once.

    The graph encloses a set of triangles. *Inflating* adds the triangle that shortens the boundary most
    (or lengthens it least) at points that the boundary passes more than once, until there are none.
    *Sculpting* then takes away boundary triangles whose inner corner is a point not yet on the boundary,
    the least increase of length first. Both keep the enclosed set's boundary closed.

    Parameters
    ----------
    mesh : Triangulation
    in_graph : (E,) bool
        The graph's edges.
    piece : (N,) int
        Connected piece of each point; triangles between pieces are never added.

    Returns
    -------
    (E,) bool
        Boundary edges, and edges of the graph that no allowed triangle could make part of a boundary.

    Notes
    -----
    Points can stay inside when no boundary triangle reaches them; they are then left out.
    """
    corners = piece[mesh.triangles]
    allowed = (corners == corners[:, :1]).all(1)
    inside = ~_outside(in_graph, mesh.edge_triangles, mesh.triangle_edges)
    arrays = (mesh.triangles, mesh.triangle_edges, mesh.edges, mesh.edge_triangles, mesh.length)
    state = _inflate(inside, in_graph, allowed, *arrays)
    wires = state == 2
    inside = ~_outside(state == 1, mesh.edge_triangles, mesh.triangle_edges)  # no pockets
    _sculpt(inside, *arrays)
    return wires | (_edge_states(inside, wires, mesh.edge_triangles) == 1)


@jit
def _outside(wall, edge_triangles, triangle_edges):
    """Triangles that can be reached from beyond the hull without crossing a wall."""
    outside = np.zeros(len(triangle_edges), np.bool_)
    stack = np.empty(len(triangle_edges), np.int64)
    top = 0
    for edge in range(len(edge_triangles)):
        triangle = edge_triangles[edge, 0]
        if edge_triangles[edge, 1] < 0 and not wall[edge] and not outside[triangle]:
            outside[triangle] = True
            stack[top] = triangle
            top += 1
    while top > 0:
        top -= 1
        here = stack[top]
        for side in range(3):
            edge = triangle_edges[here, side]
            if wall[edge]:
                continue
            other = edge_triangles[edge, 0] + edge_triangles[edge, 1] - here
            if edge_triangles[edge, 1] >= 0 and not outside[other]:
                outside[other] = True
                stack[top] = other
                top += 1
    return outside


@jit
def _edge_states(inside, in_graph, edge_triangles):
    """0: no part of the boundary, 1: parts inside from outside, 2: a wire, outside on both sides."""
    state = np.zeros(len(edge_triangles), np.int8)
    for edge in range(len(edge_triangles)):
        one = inside[edge_triangles[edge, 0]] if edge_triangles[edge, 0] >= 0 else False
        other = inside[edge_triangles[edge, 1]] if edge_triangles[edge, 1] >= 0 else False
        if one != other:
            state[edge] = 1
        elif in_graph[edge] and not one:
            state[edge] = 2
    return state


@jit
def _inflate(inside, in_graph, allowed, triangles, triangle_edges, edges, edge_triangles, length):
    state = _edge_states(inside, in_graph, edge_triangles)
    border = np.zeros(triangles.max() + 1 if len(triangles) else 0, np.int64)
    wires = np.zeros(len(border), np.int64)
    for edge in range(len(edges)):
        for end in range(2):
            if state[edge] == 1:
                border[edges[edge, end]] += 1
            elif state[edge] == 2:
                wires[edges[edge, end]] += 1
    while True:
        best, least = -1, np.inf
        for triangle in range(len(triangles)):
            if inside[triangle] or not allowed[triangle]:
                continue
            needed = False
            for corner in range(3):
                point = triangles[triangle, corner]
                touches = (
                    state[triangle_edges[triangle, (corner + 1) % 3]] > 0
                    or state[triangle_edges[triangle, (corner + 2) % 3]] > 0
                )
                needed |= touches and (wires[point] > 0 or border[point] > 2)
            if not needed:
                continue
            change = 0.0
            for side in range(3):
                edge = triangle_edges[triangle, side]
                change += length[edge] if state[edge] == 0 else -length[edge]
            if change < least:
                best, least = triangle, change
        if best < 0:
            return state
        inside[best] = True
        for side in range(3):
            edge = triangle_edges[best, side]
            for end in range(2):
                point = edges[edge, end]
                if state[edge] == 0:
                    border[point] += 1
                elif state[edge] == 1:
                    border[point] -= 1
                else:
                    wires[point] -= 1
                    border[point] += 1
            state[edge] = 0 if state[edge] == 1 else 1


@jit
def _sculpt(inside, triangles, triangle_edges, edges, edge_triangles, length):
    state = _edge_states(inside, np.zeros(len(edges), np.bool_), edge_triangles)
    on_border = np.zeros(triangles.max() + 1 if len(triangles) else 0, np.bool_)
    for edge in range(len(edges)):
        if state[edge] == 1:
            on_border[edges[edge, 0]] = on_border[edges[edge, 1]] = True
    while True:
        best, least = -1, np.inf
        for triangle in range(len(triangles)):
            if not inside[triangle]:
                continue
            for corner in range(3):
                if on_border[triangles[triangle, corner]] or state[triangle_edges[triangle, corner]] != 1:
                    continue
                change = -length[triangle_edges[triangle, corner]]
                for side in range(1, 3):
                    change += length[triangle_edges[triangle, (corner + side) % 3]]
                if change < least:
                    best, least = triangle, change
        if best < 0:
            return
        inside[best] = False
        for side in range(3):
            edge = triangle_edges[best, side]
            state[edge] = 0 if state[edge] == 1 else 1
            on_border[triangles[best, side]] = True
