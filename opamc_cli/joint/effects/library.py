"""The library: every effect by its name."""

from difflib import get_close_matches

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.asymmetric_friction import AsymmetricFriction
from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.coulomb import Coulomb
from opamc_cli.joint.effects.coupling import Coupling
from opamc_cli.joint.effects.dead_time import DeadTime
from opamc_cli.joint.effects.elasticity import Elasticity
from opamc_cli.joint.effects.gravity import Gravity
from opamc_cli.joint.effects.hysteresis import Hysteresis
from opamc_cli.joint.effects.inertia import Inertia
from opamc_cli.joint.effects.load_friction import LoadFriction
from opamc_cli.joint.effects.mains_hum import MainsHum
from opamc_cli.joint.effects.offset import Offset
from opamc_cli.joint.effects.payload_change import PayloadChange
from opamc_cli.joint.effects.position_drag import PositionDrag
from opamc_cli.joint.effects.quadratic_friction import QuadraticFriction
from opamc_cli.joint.effects.ripple import Ripple
from opamc_cli.joint.effects.sensor_gain import SensorGain
from opamc_cli.joint.effects.sensor_offset import SensorOffset
from opamc_cli.joint.effects.spring import Spring
from opamc_cli.joint.effects.stribeck import Stribeck
from opamc_cli.joint.effects.sublinear_friction import SublinearFriction
from opamc_cli.joint.effects.thermal_viscous import ThermalViscous
from opamc_cli.joint.effects.time_delay import TimeDelay
from opamc_cli.joint.effects.viscous import Viscous
from opamc_cli.joint.effects.warmup import Warmup

BUILT_IN: tuple[type[Effect], ...] = (
    Inertia,
    Gravity,
    Offset,
    Coulomb,
    Viscous,
    Stribeck,
    QuadraticFriction,
    SublinearFriction,
    AsymmetricFriction,
    LoadFriction,
    ThermalViscous,
    Warmup,
    Spring,
    PayloadChange,
    PositionDrag,
    Hysteresis,
    Elasticity,
    Coupling,
    Ripple,
    TimeDelay,
    SensorOffset,
    SensorGain,
    DeadTime,
    MainsHum,
)

Library = dict[str, Effect]


class UnknownEffectError(ConfigError):
    """A name that the library does not have."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(name, message)  # both, so that it can be sent to another process
        self.name = name

    def __str__(self) -> str:
        """Return the sentence."""
        return str(self.args[1])


def built_in_library(without: tuple[str, ...] = ()) -> Library:
    """Every effect that comes with the package."""
    return {effect.name: effect() for effect in BUILT_IN if effect.name not in without}


def effect_named(library: Library, name: str) -> Effect:
    """Look an effect up; a ConfigError names the nearest one where the library has no such."""
    if name in library:
        return library[name]
    near = get_close_matches(name, library, n=1)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(library)}"
    msg = f"Unknown effect {name!r} in the model; {hint}"
    raise UnknownEffectError(name, msg)
