"""Dead time between a command and its effect."""

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.trial import alternatives, time_constants

EFFECT = Effect(
    name="input_delay",
    site=INPUT,
    text="Every command takes effect a fixed time after it was given: bus, driver or conversion time.",
    also_called=("delay", "dead_time", "latency", "transport_delay"),
    equation=EffectEquation(r"u_{\tau}", r"u_{\tau}(t) = @u(t - \tau_u)", {"delay": r"\tau_u"}),
    parameters=(EffectParameter("delay", "s", min=0.0, max=1.0),),
    delay="delay",
    order=10,
    passes_constants=True,
    suggest_order=85,
    looks_like=("actuator_lag", "sensor_delay", "compliance"),
    trials=lambda s: alternatives("delay", time_constants(s)),
    not_cancelled="its inverse would have to act before the command is known",
)
