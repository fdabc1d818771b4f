"""Dead time between the motion and its measurement."""

from idloop.physics.effect import OUTPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.trial import alternatives, time_constants

EFFECT = Effect(
    name="sensor_delay",
    site=OUTPUT,
    text="The measurement shows the motion of a fixed time ago: conversion, filtering or bus time of the sensor.",
    also_called=("measurement_delay", "latency"),
    equation=EffectEquation(r"y_{\tau}", r"y_{\tau}(t) = @y(t - \tau_y)", {"delay": r"\tau_y"}),
    parameters=(EffectParameter("delay", "s", min=0.0, max=1.0),),
    delay="delay",
    same_as=("input_delay",),  # nothing between the command and the sensor depends on time
    by_hand={
        "input_delay": "watch the drive's current beside the command, a delay of the input is there as well, "
        "one of the sensor is not",
    },
    looks_like=("input_delay",),
    trials=lambda s: alternatives("delay", time_constants(s)),
)
