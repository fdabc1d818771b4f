"""A body that is really two, joined by a spring."""

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.trial import resonances

EFFECT = Effect(
    name="compliance",
    site=BODY,
    text="A shaft, belt or coupling gives: what looks like one body is two, joined by a spring.",
    also_called=("flexibility", "elasticity", "flexible_joint", "resonance", "shaft_stiffness"),
    equation=EffectEquation(
        "",
        r"\text{the body is two, } 1-\lambda \text{ of it with its sensors and effects, } \lambda \text{ behind, "
        r"joined by } k_c\,\Delta @q + d_c\,\Delta @v \text{; of its viscous friction } \lambda_B \text{ is behind}",
        {"stiffness": "k_c", "damping": "d_c", "split": r"\lambda", "viscous_split": r"\lambda_B"},
    ),
    parameters=(
        EffectParameter("stiffness", "{force}/{position}", start=float("inf"), neutral=float("inf"), min=0.0),
        EffectParameter("damping", "{force}·s/{position}", min=0.0),
        EffectParameter("split", "-", start=0.5, min=0.001, max=0.999),
        EffectParameter("viscous_split", "-", min=0.0, max=1.0, optional="split"),
    ),
    splits=True,
    suggest_order=90,
    looks_like=("input_delay", "actuator_lag", "presliding_friction"),
    trials=lambda s: [
        [
            {
                "stiffness": (6.2832 * frequency) ** 2 * s.inertia * split * (1.0 - split),
                "damping": 0.1 * 6.2832 * frequency * s.inertia * split * (1.0 - split),
                "split": split,
                # Bearings, seals and the back-EMF may be on either side; a fit decides.
                "viscous_split": split,
            }
        ]
        for frequency in resonances(s)
        for split in (0.5,)
    ],
    further=lambda s, plain: [[{**plain, "viscous_split": share}] for share in (0.1, 0.9)],
    not_cancelled="the spring is part of the linear motion, which is left to the controller",
)
