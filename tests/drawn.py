"""What a figure comes to when it is drawn: where its letters, legends and data are, in pixels."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.text import Text
from matplotlib.transforms import Bbox

# Boxes of text are so many pixels larger than their letters, at 100 an inch.
SLACK = 1.5


class Drawn:
    """A figure after its layout."""

    def __init__(self, figure) -> None:
        figure.set_dpi(100)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        self.figure, self.renderer = figure, canvas.get_renderer()

    def texts(self) -> list[tuple[str, Bbox]]:
        """Everything that is written, and where; ticks beyond their axis are not."""
        beyond = {id(text) for axes in self.figure.axes for text in _unseen_ticks(axes)}
        return [
            (text.get_text(), text.get_window_extent(self.renderer))
            for text in self.figure.findobj(Text)
            if text.get_visible() and text.get_text().strip() and id(text) not in beyond
        ]

    def overlaps(self) -> list[tuple[str, str]]:
        """Pairs of texts that lie on one another."""
        texts = self.texts()
        return [
            (one, other)
            for i, (one, a) in enumerate(texts)
            for other, b in texts[i + 1 :]
            if _overlap(a, b)
        ]

    def cut(self) -> list[str]:
        """Texts that leave the figure."""
        page = self.figure.bbox.padded(SLACK)
        return [
            words
            for words, box in self.texts()
            if box.x0 < page.x0 or box.x1 > page.x1 or box.y0 < page.y0 or box.y1 > page.y1
        ]

    def legends_on_data(self) -> list[str]:
        """Titles of the panels whose legend lies on something drawn, in whatever panel."""
        data = np.vstack([points for axes in self.figure.axes for points in _points(axes)])
        found = []
        for axes in self.figure.axes:
            if (legend := axes.get_legend()) is not None:
                box = legend.get_window_extent(self.renderer)
                if box.count_contains(data):
                    found.append(axes.get_title(loc="left"))
        return found


def _unseen_ticks(axes) -> list[Text]:
    found = []
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        slack = 1e-9 * (high - low)
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
            if not low - slack <= tick.get_loc() <= high + slack:
                found += [tick.label1, tick.label2]
    return found


def _points(axes) -> list[np.ndarray]:
    """Points of lines and bands within their axes, and some between each two."""
    parts = [
        line.get_xydata() for line in axes.get_lines() if line.get_transform() == axes.transData
    ]
    for band in axes.collections:
        if isinstance(band, PolyCollection):
            parts += [path.vertices for path in band.get_paths()]
    seen = [np.empty((0, 2))]
    for part in parts:
        corners = axes.transData.transform(np.asarray(part, dtype=float))
        steps = np.linspace(0.0, 1.0, 5)[:, None, None]
        points = (corners[:-1] + steps * np.diff(corners, axis=0)).reshape(-1, 2)
        points = points[np.isfinite(points).all(axis=1)]
        box = axes.bbox
        inside = (points >= (box.x0, box.y0)).all(axis=1) & (points <= (box.x1, box.y1)).all(axis=1)
        seen.append(points[inside])
    return seen


def _overlap(a: Bbox, b: Bbox) -> bool:
    across = min(a.x1, b.x1) - max(a.x0, b.x0)
    along = min(a.y1, b.y1) - max(a.y0, b.y0)
    return across > SLACK and along > SLACK
