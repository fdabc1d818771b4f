from idloop.estimation.criterion import InitialStates
from idloop.estimation.dataset import prepare
from idloop.physics import Engine


def test_sizes_of_initial_states_are_plain_numbers(motor, experiment):
    data = prepare(motor, [experiment(motor)])
    for force in (None, 2.0):
        assert InitialStates(Engine(motor), data, force).scale.dtype == float
