"""Effects with memory at the input: the force balance finds them, predictions separate a delay from a lag."""

import pytest

from idloop.diagnosis import diagnose


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["actuator_lag", "input_delay"])
def test_a_lag_is_no_delay_and_a_delay_no_lag(effect: str) -> None:
    from cases import singles
    from experiment import experiment

    data = experiment(next(case for case in singles() if case.id == f"single/{effect}/axis/input/dominant"))
    (by_force,) = diagnose(data.start, data.training, criterion="force").set
    assert by_force in ("actuator_lag@input", "input_delay@input")
    assert diagnose(data.start, data.training).set == (f"{effect}@input",)
