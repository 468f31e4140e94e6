"""Units of a model, as `--units FORCE,LENGTH,TIME` gives them."""

from __future__ import annotations

from dataclasses import dataclass

from . import Refused

POUND_FORCE = 4.4482216152605
STANDARD_GRAVITY = 9.80665
# Each unit in SI units.
FORCES = {
    "N": 1.0,
    "kN": 1e3,
    "MN": 1e6,
    "kgf": STANDARD_GRAVITY,
    "tf": 1e3 * STANDARD_GRAVITY,
    "lbf": POUND_FORCE,
    "lb": POUND_FORCE,
    "kip": 1e3 * POUND_FORCE,
}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3}


@dataclass(frozen=True)
class Units:
    """The units of a model in SI units: `force` in N, `length` in m, `time` in s. The unit of mass follows from them."""

    force: float
    length: float
    time: float

    @property
    def mass(self) -> float:
        """The unit of mass, kg."""
        return self.force * self.time**2 / self.length


def parse(text: str) -> Units:
    """The units of a text such as `kN,m,s`."""
    names = [name.strip() for name in text.split(",")]
    kinds = (("force", FORCES), ("length", LENGTHS), ("time", TIMES))
    if len(names) != len(kinds):
        raise Refused(f"--units {text}: found {len(names)} units, but force, length and time are needed, for example kN,m,s")
    factors = []
    for name, (kind, known) in zip(names, kinds):
        if name not in known:
            raise Refused(f"--units {text}: {name!r} is not a unit of {kind}; known are {', '.join(known)}")
        factors.append(known[name])
    return Units(*factors)
