"""Nonlinear ARX models: tapped delays with a wavelet network or a neural network behind them.

``save`` and ``load`` keep them in files.
"""

from __future__ import annotations

from idloop.estimate.networks.division import Division, Split
from idloop.estimate.networks.model import NarxModel
from idloop.estimate.networks.model_file import load, save
from idloop.estimate.networks.neural import narx_neural
from idloop.estimate.networks.tapped_delays import TappedDelays
from idloop.estimate.networks.training import TrainingHistory, TrainingRules
from idloop.estimate.networks.wavelet import narx_wavelet

__all__ = [
    "Division",
    "NarxModel",
    "Split",
    "TappedDelays",
    "TrainingHistory",
    "TrainingRules",
    "load",
    "narx_neural",
    "narx_wavelet",
    "save",
]
