"""Dead time between the motion and its measurement."""

from idloop.physics.effect import OUTPUT, Effect, ParameterSpec
from idloop.physics.trial import alternatives, time_constants

EFFECT = Effect(
    name="sensor_delay",
    site=OUTPUT,
    text="The measurement shows the motion of a fixed time ago: conversion, filtering or bus time of the sensor.",
    parameters=(ParameterSpec("delay", "s", min=0.0, max=1.0),),
    delay="delay",
    looks_like=("input_delay",),
    trials=lambda s: alternatives("delay", time_constants(s)),
)
