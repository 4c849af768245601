"""Lens distortion: where a ray of the ideal pinhole camera meets the image that a lens makes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.lazy import cached_property

Array = NDArray[np.float64]

Model: TypeAlias = Literal["brown-conrady", "modified brown-conrady", "inverse brown-conrady"]
"""What the polynomial is applied to; the first is OpenCV's, with four, five or eight numbers."""

WIDEST = 20.0
"""Tangent of the largest angle off the axis that is asked for, 87 degrees."""

KNOTS = 4096
"""Radii at which the radial part is worked out, for a first guess of its inverse."""

STEPS = 20
"""Steps of Newton's method, of which three are enough near the axis."""

CLOSE = 1e-11
"""Error, in the plane one metre away, of a point that was found."""


@dataclass(frozen=True)
class Distortion:
    """How a lens displaces the points (x, y) of the plane one metre in front of it.

    Parameters
    ----------
    model
        ``"brown-conrady"``: the polynomial takes the ideal point to the one in the image, as in
        OpenCV and ROS (plumb_bob, and rational_polynomial with eight coefficients).
        ``"modified brown-conrady"``: the tangential part is applied to the point that the radial
        part has moved. ``"inverse brown-conrady"``: the polynomial takes the point in the
        image to the ideal one. The last two are RealSense's.
    coefficients
        k1, k2, p1, p2[, k3[, k4, k5, k6]], in OpenCV's order; what is left out is 0.
    reach
        Largest radius of an ideal point for which the polynomial was fitted, metres in that
        plane. Beyond it, and beyond the radius at which the polynomial turns back, no
        point is seen.

    Raises
    ------
    InputError
        An unknown model, another number of coefficients, or one that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import Distortion
    >>> barrel = Distortion("brown-conrady", (-0.1, 0.0, 0.0, 0.0))
    >>> x, _ = barrel.distort(np.array([0.5]), np.array([0.0]))
    >>> x.round(4)
    array([0.4875])
    """

    model: Model
    coefficients: tuple[float, ...]
    reach: float = math.inf

    def __post_init__(self) -> None:
        """Refuse what is no distortion."""
        if self.model not in get_args(Model):
            raise InputError(
                f"distortion: unknown model {self.model!r}, expected one of "
                f"{', '.join(get_args(Model))}"
            )
        try:
            numbers = tuple(float(number) for number in self.coefficients)
        except (TypeError, ValueError, OverflowError):
            numbers = (math.nan,)
        # What lenses of OpenCV have beyond the eighth (thin prism, tilt) must be nothing.
        while len(numbers) > 8 and numbers[-1] == 0.0:
            numbers = numbers[:-1]
        if len(numbers) not in (0, 4, 5, 8) or not all(map(math.isfinite, numbers)):
            raise InputError(
                "distortion: expected four, five or eight finite coefficients k1, k2, p1, p2, k3, "
                f"k4, k5, k6, got {str(self.coefficients)[:80]}"
            )
        if self.model != "brown-conrady" and len(numbers) == 8 and any(numbers[5:]):
            raise InputError(f"distortion: {self.model} has five coefficients, got {numbers}")
        if not self.reach > 0.0:
            raise InputError(f"distortion: expected a positive reach, got {self.reach}")
        object.__setattr__(self, "coefficients", numbers + (0.0,) * (8 - len(numbers)))
        object.__setattr__(self, "reach", float(self.reach))

    def __bool__(self) -> bool:
        """Whether it displaces anything."""
        return any(self.coefficients)

    def distort(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Take ideal points to those in the image; NaN where the lens shows none."""
        points = np.asarray(x, np.float64), np.asarray(y, np.float64)
        if self.model == "inverse brown-conrady":
            return self._solved(*points)
        return self._evaluated(*points)

    def undistort(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Take points in the image to the ideal ones; NaN where no ray meets them."""
        points = np.asarray(x, np.float64), np.asarray(y, np.float64)
        if self.model == "inverse brown-conrady":
            return self._evaluated(*points)
        return self._solved(*points)

    @cached_property
    def _end(self) -> float:
        """Largest radius up to which the radial part grows and has no pole."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        with np.errstate(all="ignore"):
            above, below = np.poly1d([k3, k2, k1, 1.0]), np.poly1d([k6, k5, k4, 1.0])
            square = np.poly1d([1.0, 0.0])
            grows = (above + 2 * square * above.deriv()) * below
            slope = grows - above * (2 * square * below.deriv())
            try:
                roots = np.concatenate([np.atleast_1d(slope.roots), np.atleast_1d(below.roots)])
            except np.linalg.LinAlgError:  # coefficients too large for their squares
                roots = np.full(1, np.finfo(float).tiny)
        real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
        return min(self.reach, WIDEST, math.sqrt(real.min()) if len(real) else math.inf)

    def _radial(self, square: Array) -> tuple[Array, Array]:
        """Return the radial factor at squared radii, and its slope there."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        above = 1.0 + square * (k1 + square * (k2 + square * k3))
        below = 1.0 + square * (k4 + square * (k5 + square * k6))
        above_slope = k1 + square * (2.0 * k2 + square * 3.0 * k3)
        below_slope = k4 + square * (2.0 * k5 + square * 3.0 * k6)
        factor = above / below
        return factor, (above_slope - factor * below_slope) / below

    def _evaluated(self, x: Array, y: Array) -> tuple[Array, Array]:
        with np.errstate(all="ignore"):
            square = x * x + y * y
            u, v, *_ = self._polynomial(x, y)
            beyond = ~(square <= self._end**2)
            return np.where(beyond, np.nan, u), np.where(beyond, np.nan, v)

    def _polynomial(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return the displaced points, and the four derivatives of u and v by x and y."""
        _, _, p1, p2, *_ = self.coefficients
        square = x * x + y * y
        factor, slope = self._radial(square)
        a, b = x * factor, y * factor
        a_x, a_y, b_y = (
            factor + 2.0 * x * x * slope,
            2.0 * x * y * slope,
            factor + 2.0 * y * y * slope,
        )
        if self.model == "modified brown-conrady":
            s, t, s_x, s_y, t_x, t_y = a, b, a_x, a_y, a_y, b_y
        else:
            one, none = np.ones_like(x), np.zeros_like(x)
            s, t, s_x, s_y, t_x, t_y = x, y, one, none, none, one
        u = a + 2.0 * p1 * s * t + p2 * (square + 2.0 * s * s)
        v = b + 2.0 * p2 * s * t + p1 * (square + 2.0 * t * t)
        u_x = a_x + 2.0 * p1 * (s_x * t + s * t_x) + p2 * (2.0 * x + 4.0 * s * s_x)
        u_y = a_y + 2.0 * p1 * (s_y * t + s * t_y) + p2 * (2.0 * y + 4.0 * s * s_y)
        v_x = a_y + 2.0 * p2 * (s_x * t + s * t_x) + p1 * (2.0 * x + 4.0 * t * t_x)
        v_y = b_y + 2.0 * p2 * (s_y * t + s * t_y) + p1 * (2.0 * y + 4.0 * t * t_y)
        return u, v, u_x, u_y, v_x, v_y

    def _solved(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Find the points that the polynomial takes to (u, v), by Newton's method."""
        end = self._end
        with np.errstate(all="ignore"):
            # The radial part, which is most of it, is turned round in a table first.
            radii = np.linspace(0.0, end, KNOTS)
            images = radii * self._radial(radii**2)[0]
            sought = np.hypot(u, v)
            guess = np.interp(sought, images, radii)
            scale = np.where(sought > 0.0, guess / np.where(sought > 0.0, sought, 1.0), 1.0)
            x, y = np.ravel(u * scale), np.ravel(v * scale)
            sought_u, sought_v = np.ravel(u), np.ravel(v)
            left = np.arange(x.size)
            found = np.zeros(x.size, bool)
            for _ in range(STEPS):
                at_u, at_v, u_x, u_y, v_x, v_y = self._polynomial(x[left], y[left])
                off_u, off_v = sought_u[left] - at_u, sought_v[left] - at_v
                close = np.abs(off_u) + np.abs(off_v) <= CLOSE
                found[left[close]] = True
                area = u_x * v_y - u_y * v_x
                x[left] += np.where(close, 0.0, (v_y * off_u - u_y * off_v) / area)
                y[left] += np.where(close, 0.0, (u_x * off_v - v_x * off_u) / area)
                left = left[~close & np.isfinite(x[left]) & np.isfinite(y[left])]
                if not len(left):
                    break
            found &= x * x + y * y <= end**2 * (1.0 + 1e-9)
        shape = np.shape(u)
        return (
            np.where(found, x, np.nan).reshape(shape),
            np.where(found, y, np.nan).reshape(shape),
        )
