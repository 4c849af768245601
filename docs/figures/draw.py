"""Draw the pictures of the documentation that need no data: ``python docs/figures/draw.py``.

Two views of the desk that ``hmrf-icp demo`` renders, a pair of views that share too little, and a
scan of a wavy plate with a bump and a dent. Those of the method are drawn by every build of the
site, too (``docs/hooks/figures.py``).
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

import hmrf_icp
from hmrf_icp import plot, presets, se3
from hmrf_icp.cli.demo import NAMES, DeskPair, desk_pair
from hmrf_icp.figures.labels import colour_bar, image_of, label_scale
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.registration import field_before_first_step
from hmrf_icp.figures.states import states_of
from hmrf_icp.figures.style import DPI, ink, own_figure
from hmrf_icp.io.whole import written_whole
from hmrf_icp.synthetic.render import render, sensor_noise
from hmrf_icp.synthetic.scenes import CAMERA, desk, trajectory

HERE = Path(__file__).parent


def axes(width: float, height: float, room: tuple[float, float, float, float]) -> Axes:
    """Axes in a figure without a ground, inches; room left, below, right and above."""
    left, below, right, above = room
    place = (left / width, below / height)
    size = (1.0 - (left + right) / width, 1.0 - (below + above) / height)
    return own_figure(width, height).add_axes((*place, *size))


def save(figure: Any, name: str) -> None:
    """Write a PNG beside this file."""
    with written_whole(HERE / name) as partial:
        figure.savefig(partial, dpi=DPI)


def of_the_desk(pair: DeskPair) -> None:
    """Draw every figure of the demo's pair."""
    result = hmrf_icp.register(pair.source, pair.target, pair.init)
    told: dict[str, Any] = {"names": NAMES, "method": "robust"}
    plot.registration_figure(
        pair.source,
        pair.target,
        result,
        HERE / "demo.png",
        pair.init,
        field_before_first_step(pair.source, pair.target, pair.init),
        **told,
    )
    ax = axes(9.0, 4.2, (0.1, 0.35, 0.1, 0.6))
    save(plot.before_after(result, ax=ax, init=pair.init, **told).figure, "before-after.png")
    ax = axes(5.6, 4.8, (0.1, 0.65, 0.1, 0.6))
    save(plot.labels(result, ax=ax, **told).figure, "labels.png")
    ax = axes(5.6, 5.2, (0.1, 0.65, 0.1, 0.6))
    save(plot.field(result, ax, **told).figure, "field.png")
    ax = axes(5.6, 4.2, (0.65, 0.5, 0.1, 0.6))
    save(plot.residuals(result, ax, **told).figure, "residuals-end.png")
    save(plot.residual_figure(result.distance), "residuals.png")


def of_the_method(pair: DeskPair) -> dict[str, Any]:
    """Figures of Algorithm 1 as the paper has it, by their names."""
    result = hmrf_icp.register(pair.source, pair.target, pair.init, preset="paper")
    ax = axes(5.6, 4.2, (0.7, 0.5, 0.65, 0.6))
    plot.convergence(result, ax, names=NAMES, method="paper")
    field = own_figure(9.0, 3.1)
    between = Pair.of(result)
    start = between.between(se3.as_rigid(pair.init))
    states = states_of(between, result, start, presets.PAPER)
    for k, number in enumerate((0, 2, len(states) - 1)):
        panel = field.add_axes((0.01 + 0.33 * k, 0.18, 0.32, 0.72))
        labels = states[number].probability
        image_of(panel, pair.source.on_grid(labels), label_scale())
        where = f"after {number} iterations" if number else "at the start"
        title = f"{where}: {np.mean(labels > 0.5):.0%} inliers"
        panel.set_title(title, loc="left", fontsize=10, color=ink(panel))
        if k == 1:
            colour_bar(panel, label_scale(), "probability of being an inlier; hatched: unobserved")
    return {"convergence.png": ax.figure, "method-field.png": field}


def films(pair: DeskPair) -> None:
    """Film the default without a start, for pages and as MP4, and the paper's method."""
    told: dict[str, Any] = {"truth": pair.truth, "names": NAMES}
    small: dict[str, Any] = {"fps": 10, "seconds": 3.0, "size": (640, 360)}
    recording = plot.Recording()
    result = hmrf_icp.register(pair.source, pair.target, on_iteration=recording)
    plot.animate(HERE / "film.gif", result, recording=recording, **told, **small)
    plot.animate(HERE / "film.mp4", result, recording=recording, fps=20, **told)
    paper = hmrf_icp.register(pair.source, pair.target, pair.init, preset="paper")
    plot.animate(HERE / "film-paper.gif", paper, init=pair.init, preset="paper", **told, **small)


def not_believed() -> None:
    """Show two views that share next to nothing."""
    poses, noise = trajectory("desk", 60), np.random.default_rng(0)
    source, target = (
        hmrf_icp.PointCloud.from_depth(
            sensor_noise(render(desk(), CAMERA, poses[k]), CAMERA, noise), CAMERA
        ).subsample(4)
        for k in (44, 4)
    )
    result = hmrf_icp.register(source, target)
    assert not result.believed, result
    ax = axes(9.0, 4.4, (0.1, 0.35, 0.1, 0.9))
    save(plot.before_after(result, ax=ax, method="robust").figure, "not-believed.png")


def deviations_of_a_plate() -> None:
    """Measure a scan of a plate with a bump, a dent and a part that the model does not have."""
    rng = np.random.default_rng(1)

    def surface(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = xy.T
        z = 0.02 * np.sin(12.0 * x) * np.cos(9.0 * y) + 0.06 * x * y
        dx = 0.24 * np.cos(12.0 * x) * np.cos(9.0 * y) + 0.06 * y
        dy = -0.18 * np.sin(12.0 * x) * np.sin(9.0 * y) + 0.06 * x
        return np.column_stack([xy, z]), np.column_stack([-dx, -dy, np.ones_like(x)])

    points, normals = surface(rng.uniform((-0.3, -0.2), (0.3, 0.2), (20_000, 2)))
    model = hmrf_icp.PointCloud(points, normals=normals)
    points, normals = surface(rng.uniform((-0.34, -0.2), (0.3, 0.2), (20_000, 2)))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    bump = np.zeros(len(points))
    for x, y, high in ((0.12, 0.05, 0.004), (-0.1, -0.08, -0.003)):
        bump += high * np.exp(-(np.hypot(points[:, 0] - x, points[:, 1] - y) ** 2) / 0.03**2)
    points += (bump + rng.normal(0.0, 0.0003, len(points)))[:, None] * normals
    turn = se3.rotation_about((0.2, 1.0, 0.3), 0.1, (0.0, 0.0, 0.1))
    result = hmrf_icp.register(se3.transform(turn, points), model)
    ax = axes(5.6, 4.8, (0.1, 0.9, 0.1, 0.6))
    told: dict[str, Any] = {"names": ("scan", "model"), "method": "robust"}
    save(plot.deviation(result, ax=ax, tolerance=0.001, **told).figure, "deviation.png")


def main() -> None:
    """Draw them all."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
        pair = desk_pair()
        of_the_desk(pair)
        for name, figure in of_the_method(pair).items():
            save(figure, name)
        films(pair)
        not_believed()
        deviations_of_a_plate()


if __name__ == "__main__":
    main()
