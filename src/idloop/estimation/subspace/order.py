"""How many states the data show: singular values, canonical correlations and what noise alone would give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.labels import new_axes

if TYPE_CHECKING:
    from idloop.estimation.linear.model import LinearModel


@dataclass(frozen=True, eq=False)
class OrderSelection:
    """Number of states and the evidence for it."""

    method: str  # subspace method
    horizon: int  # samples of past and of future
    singular_values: Array  # shape (r,): of the method's weighted projection
    correlations: Array  # shape (s,): canonical correlations between past and future, whatever the method's weights
    threshold: float  # correlation that unrelated past and future would hardly exceed
    order: int  # number of correlations above it, one at least

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "method": self.method,
            "horizon": self.horizon,
            "order": self.order,
            "singular_values": self.singular_values,
            "canonical_correlations": self.correlations,
            "threshold": self.threshold,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw the singular values over the canonical correlations; returns the two matplotlib axes."""
        from idloop import drawing

        with drawing.styled():
            axes = new_axes(axes, 2, 5)
            top, bottom = axes
            _stems(top, self.singular_values, self.order, "singular value [-]")
            top.set_title(f"{self.method}, horizon {self.horizon} samples: order {self.order}")
            _stems(bottom, self.correlations, self.order, "canonical correlation [-]")
            bottom.axhline(self.threshold, color=drawing.BAND, label="noise alone stays below")
            bottom.legend()
            bottom.set_xlabel("order [-]")
        return axes


def singular_value_plot(model: LinearModel, axes: Any = None) -> Any:
    """Draw a subspace model's singular values on a logarithmic axis, those it kept in another colour.

    Parameters
    ----------
    model : LinearModel
        From a subspace method.

    Raises
    ------
    InputError
        The model comes from another kind of method.
    """
    from idloop import drawing

    if model.singular_values is None:
        raise InputError(f"model {model.method} has no singular values; identify it with a subspace method")
    with drawing.styled():
        axes = new_axes(axes, 1, 3)
        _stems(axes, model.singular_values, model.order, "singular value [-]")
        axes.set_title(f"{model.method}, order {model.order}")
        axes.set_xlabel("order [-]")
    return axes


def significant(correlations: Array, past: int, future: int, windows: int) -> tuple[int, float]:
    """Order by the edge of the canonical correlations of unrelated data.

    `correlations`: largest first; `past`, `future`: numbers of rows of past and future; `windows`: columns of the
    Hankel matrix.

    Notes
    -----
    The largest correlation of unrelated white data tends to
    ``sqrt(s (1 - t)) + sqrt(t (1 - s))`` with s = past/windows and t = future/windows (Wachter, Ann. Statist. 8,
    1980). Neighbouring windows share samples and the past is finite, which raises the edge: twice the squared
    correlation is asked for.
    """
    s, t = min(past / windows, 1.0), min(future / windows, 1.0)
    edge = (np.sqrt(s * (1.0 - t)) + np.sqrt(t * (1.0 - s))) if s + t < 1.0 else 1.0
    threshold = min(np.sqrt(2.0) * edge, 1.0 - 1e-9)
    return max(int(np.sum(correlations > threshold)), 1), float(threshold)


def check_order(order: int | str, horizon: int, outputs: int) -> None:
    """Refuse an order that windows of this horizon cannot show."""
    largest = (horizon - 1) * outputs
    if isinstance(order, str):
        if order != "auto":
            raise InputError(f'order "{order}" is neither "auto" nor a number of states')
    elif not 1 <= order <= largest:
        raise InputError(
            f"order {order} with a horizon of {horizon} samples; give 1 to {largest} states or a longer horizon"
        )


def _stems(axes: Any, values: Array | Sequence[float], order: int, label: str) -> None:
    from idloop import drawing

    numbers = np.arange(1, len(values) + 1)
    for part, color in ((numbers <= order, drawing.MODELS[0]), (numbers > order, drawing.BAND)):
        axes.semilogy(numbers[part], np.asarray(values)[part], "o", color=color, markersize=4)
    axes.set_ylabel(label)
