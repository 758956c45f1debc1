"""What a design searches: the parameters of all joints, the problem they belong to, and which of them are free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.geometry.frames import tangents
from planners.cone_joints.energy import Loads
from planners.cone_joints.shapes import Shapes


@dataclass(frozen=True, eq=False)
class JointParameters:
    """All unknowns of a design.

    Attributes:
        shape: (E, S) parameters of each joint.
        lean: (Q, L) lean of each pair's principal direction, radians.
        axis: (N, d) unit direction a_j = −d_j in which each part leaves.
        curved: (E,) joints that may change; the others stay planar.
    """

    shape: Array
    lean: Array
    axis: Array
    curved: BoolArray

    def stepped(self, column: int, step: float) -> JointParameters:
        """Return them with one parameter of every joint, or one lean of every pair, larger by `step`."""
        shape, lean = self.shape.copy(), self.lean.copy()
        if column < shape.shape[1]:
            shape[:, column] += step
        else:
            lean[:, column - shape.shape[1]] += step
        return JointParameters(shape, lean, self.axis, self.curved)


@dataclass(frozen=True, eq=False, kw_only=True)
class JointProblem:
    """What the descent needs to know besides the parameters.

    Attributes:
        shapes: the parametrised joints.
        loads: required cases first, then margin cases.
        required: number of required cases.
        pairs: (E, 2) parts of each joint.
        alpha_rad: assemblability, None when not asked for.
        turning: (N,) parts whose way out may turn with the joints; the others keep theirs.
    """

    shapes: Shapes
    loads: Loads
    required: int
    pairs: IntArray
    alpha_rad: float | None
    turning: BoolArray


@dataclass(frozen=True, eq=False, kw_only=True)
class UnknownsLayout:
    """The unknowns in a row: shapes of curved joints, leans of their pairs, tangential moves of part axes.

    Of joints that are to look alike there is one shape, whose bounds are those that all of them have in common.
    """

    joints: IntArray
    pairs: IntArray
    parts: IntArray
    tangents: Array
    bounds: tuple[Array, Array]
    sizes: tuple[int, int, int]
    steepest_lean: float
    alike: bool

    @classmethod
    def of(cls, problem: JointProblem, parameters: JointParameters) -> UnknownsLayout:
        """Return the layout about `parameters`."""
        joints = np.flatnonzero(parameters.curved)
        pairs = np.unique(problem.shapes.pair[joints])
        axis = parameters.axis
        parts = np.unique(problem.pairs[:, 1])
        parts = parts[problem.turning[parts]]
        across = tangents(axis)
        s, lean, t = parameters.shape.shape[1], parameters.lean.shape[1], across.shape[1]
        alike = problem.shapes.options.alike and len(joints) > 0
        sizes = (s if alike else len(joints) * s, len(pairs) * lean, len(parts) * t)
        return cls(
            joints=joints,
            pairs=pairs,
            parts=parts,
            tangents=across,
            bounds=_common(problem.shapes.bounds(), joints) if alike else problem.shapes.bounds(),
            sizes=sizes,
            steepest_lean=problem.shapes.steepest_lean,
            alike=alike,
        )

    def moved(self, start: JointParameters, step: Array) -> JointParameters:
        """Return `start` moved by `step`, shapes and leans kept within their bounds."""
        n_shape, n_lean, _ = self.sizes
        shape, lean, axis = start.shape.copy(), start.lean.copy(), start.axis.copy()
        shape[self.joints] += step[:n_shape].reshape(-1, shape.shape[1])
        low, high = self.bounds
        shape[self.joints] = np.clip(shape[self.joints], low[self.joints], high[self.joints])
        lean[self.pairs] += step[n_shape : n_shape + n_lean].reshape(len(self.pairs), lean.shape[1])
        lean[self.pairs] = np.clip(lean[self.pairs], -self.steepest_lean, self.steepest_lean)
        moves = step[n_shape + n_lean :].reshape(len(self.parts), self.tangents.shape[1])
        axis[self.parts] += np.einsum("pt,ptd->pd", moves, self.tangents[self.parts])
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        return JointParameters(shape, lean, axis, start.curved)

    def blocked(self, parameters: JointParameters, gradient: Array) -> BoolArray:
        """Return (n,) which unknowns sit at a bound and would leave it downhill."""
        n_shape, n_lean, _ = self.sizes
        low, high = self.bounds
        joints = self.joints[:1] if self.alike else self.joints
        value = np.concatenate([parameters.shape[joints].ravel(), parameters.lean[self.pairs].ravel()])
        lower = np.concatenate([low[joints].ravel(), np.full(n_lean, -self.steepest_lean)])
        upper = np.concatenate([high[joints].ravel(), np.full(n_lean, self.steepest_lean)])
        blocked = np.zeros(len(gradient), dtype=np.bool_)
        downhill = gradient[: n_shape + n_lean]
        blocked[: n_shape + n_lean] = ((value <= lower) & (downhill > 0)) | ((value >= upper) & (downhill < 0))
        return blocked

    def columns(self, shapes: Shapes) -> IntArray:
        """Return (S + L, E) the unknown that each joint's parameter is, −1 for none."""
        count, n_shape = len(shapes.pair), self.sizes[0]
        s, lean = len(shapes.rest), shapes.n_lean
        columns = np.full((s + lean, count), -1)
        columns[:s, self.joints] = np.arange(n_shape).reshape(-1, s).T
        where = np.full(len(shapes.pair_normal), -1)
        where[self.pairs] = np.arange(len(self.pairs))
        mine = where[shapes.pair[self.joints]]
        for k in range(lean):
            columns[s + k, self.joints] = n_shape + mine * lean + k
        return columns


def _common(bounds: tuple[Array, Array], joints: IntArray) -> tuple[Array, Array]:
    """Return bounds (E, S) that shapes keep which are within those of all `joints`."""
    low, high = bounds
    most, least = low[joints].max(axis=0), high[joints].min(axis=0)
    return np.tile(np.minimum(most, least), (len(low), 1)), np.tile(least, (len(high), 1))


def made_alike(parameters: JointParameters, heights: tuple[int, ...]) -> JointParameters:
    """Return parameters with one shape: the lowest of the bumps on the side that most of them are on.

    Joints on the other side, and those with less than half of the usual height, stay planar.
    """
    height = parameters.shape[:, heights[0]]
    sign = np.sign(height[parameters.curved].sum()) or 1.0
    curved = parameters.curved & (sign * height > 0.0)
    if not curved.any():
        return parameters
    curved &= np.abs(height) >= 0.5 * np.median(np.abs(height[curved]))
    one = parameters.shape[np.flatnonzero(curved)[np.abs(height[curved]).argmin()]]
    return JointParameters(np.tile(one, (len(height), 1)), parameters.lean, parameters.axis, curved)
