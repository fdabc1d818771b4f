"""Orders and delays of the polynomials of one output, and where each coefficient stands in a vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from idloop.errors import InputError


@dataclass(frozen=True)
class Orders:
    """Degrees of A, C, D, number of coefficients of B and degree of F of each input, and its delay.

    Attributes
    ----------
    na, nc, nd : int
        Degrees of A, C and D.
    nb, nf, nk : tuple of int, one per input
        Number of coefficients of B, degree of F, delay [samples].

    Raises
    ------
    InputError
        Negative numbers, or not one of nb, nf and nk per input.
    """

    na: int
    nb: tuple[int, ...]
    nc: int
    nd: int
    nf: tuple[int, ...]
    nk: tuple[int, ...]

    def __post_init__(self) -> None:
        if not len(self.nb) == len(self.nf) == len(self.nk):
            raise InputError(f"orders nb {self.nb}, nf {self.nf}, nk {self.nk}: give one of each per input")
        numbers = {"na": (self.na,), "nb": self.nb, "nc": (self.nc,), "nd": (self.nd,), "nf": self.nf, "nk": self.nk}
        for name, values in numbers.items():
            if any(value < 0 for value in values):
                raise InputError(f"order {name} = {', '.join(map(str, values))}; orders and delays must be 0 or more")
        if self.size == 0:
            raise InputError("all orders are 0: nothing to estimate; give na, nb or nc at least 1")

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.nb)

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.na + sum(self.nb) + self.nc + self.nd + sum(self.nf)

    @property
    def a(self) -> slice:
        """Place of the coefficients of A."""
        return slice(0, self.na)

    def b(self, index: int) -> slice:
        """Place of the coefficients of B of one input."""
        first = self.na + sum(self.nb[:index])
        return slice(first, first + self.nb[index])

    @property
    def c(self) -> slice:
        """Place of the coefficients of C."""
        first = self.na + sum(self.nb)
        return slice(first, first + self.nc)

    @property
    def d(self) -> slice:
        """Place of the coefficients of D."""
        first = self.c.stop
        return slice(first, first + self.nd)

    def f(self, index: int) -> slice:
        """Place of the coefficients of F of one input."""
        first = self.d.stop + sum(self.nf[:index])
        return slice(first, first + self.nf[index])

    def names(self, inputs: Sequence[str]) -> tuple[str, ...]:
        """Names of the coefficients; the number is the lag: b3[u] multiplies u(t - 3).

        Parameters
        ----------
        inputs : sequence of str
            Names of the inputs.
        """
        names = [f"a{k}" for k in range(1, self.na + 1)]
        for nb, nk, name in zip(self.nb, self.nk, inputs, strict=True):
            names += [f"b{k}[{name}]" for k in range(nk, nk + nb)]
        names += [f"c{k}" for k in range(1, self.nc + 1)] + [f"d{k}" for k in range(1, self.nd + 1)]
        for nf, name in zip(self.nf, inputs, strict=True):
            names += [f"f{k}[{name}]" for k in range(1, nf + 1)]
        return tuple(names)


def per_input(value: int | Sequence[int], inputs: int, name: str) -> tuple[int, ...]:
    """Spread one number over all inputs, or check that there is one for each.

    Raises InputError: another count than that of the inputs.
    """
    values = (int(value),) * inputs if isinstance(value, int) else tuple(int(v) for v in value)
    if len(values) != inputs:
        raise InputError(f"{name} has {len(values)} entries for {inputs} inputs; give one number or one per input")
    return values
