"""What one joint of the virtual robot is made of, in SI units.

The values, each with its source or the word "assumed", stand in `configs/testbed.yaml`.
"""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Motor:
    """Permanent-magnet servo motor and its field-oriented drive."""

    pole_pairs: int
    torque_constant_nm_per_a: float
    inertia_kgm2: float  # rotor and wave generator, motor side
    resistance_ohm: float
    inductance_h: float
    bus_voltage_v: float
    current_limit_a: float
    cogging_order: float  # per motor turn, lcm(slots, poles)
    cogging_torque_nm: float


@dataclass(frozen=True)
class Control:
    """Cascade on the motor encoder: position P, velocity PI, current loop, feed-forward."""

    position_gain_per_s: float
    velocity_bandwidth_hz: float
    velocity_integral_time_s: float
    current_bandwidth_hz: float
    velocity_filter_hz: float
    encoder_counts_per_turn: float  # 0: no quantisation
    inertia_feedforward: float  # share of the nominal torque, 0..1
    friction_feedforward: float
    gravity_feedforward: float


@dataclass(frozen=True)
class Gear:
    """Strain wave gear, joint side; the circular spline is fixed, the flexspline drives."""

    ratio: float
    stiffness_nm_per_rad: float
    stiffening_nm_per_rad3: float
    damping_nms_per_rad: float
    hysteresis_torque_nm: float
    hysteresis_width_rad: float
    error_2_circular_rad: float  # kinematic error, 2 per turn of the wave generator in the
    error_4_circular_rad: float  # frame of the circular spline, joint side
    error_2_flexspline_rad: float  # and in the frame of the turning flexspline
    error_4_flexspline_rad: float
    tooth_mesh_torque_nm: float  # motor side, once per tooth of the circular spline


@dataclass(frozen=True)
class Friction:
    """Friction at the wave generator (motor side) and in the output bearing (joint side)."""

    coulomb_nm: float
    viscous_nms_per_rad: float
    stribeck_nm: float
    stribeck_velocity_rad_s: float
    smoothing_velocity_rad_s: float  # width of the smoothed sign of the velocity
    load_coefficient: float  # motor-side N.m of friction per joint-side N.m of load
    viscous_per_kelvin: float  # relative fall of the viscous coefficient per kelvin
    coulomb_per_kelvin: float
    fluctuation_nm: float  # standard deviation of what does not repeat, at 2 kHz, motor side
    output_coulomb_nm: float
    output_viscous_nms_per_rad: float


@dataclass(frozen=True)
class Link:
    """All that the joint carries, seen as one body about the joint's axis."""

    inertia_kgm2: float
    gravity_torque_nm: float  # largest, without payload
    gravity_angle_rad: float  # joint angle at which gravity's torque is zero
    payload_arm_m: float  # distance of the payload from the joint's axis
    payload_gravity_share: float  # 0 for a vertical axis, 1 for a horizontal one


@dataclass(frozen=True)
class Thermal:
    """One-body heating by copper and friction losses."""

    ambient_c: float
    resistance_k_per_w: float
    time_constant_s: float


@dataclass(frozen=True)
class Joint:
    """One axis of the robot."""

    motor: Motor
    control: Control
    gear: Gear
    friction: Friction
    link: Link
    thermal: Thermal


@dataclass(frozen=True)
class Sensor:
    """Current measurement of one robot: three Hall sensors and a converter per axis."""

    noise_a: float  # standard deviation per sample and phase
    offset_a: float  # standard deviation over phases and sessions
    gain: float  # standard deviation of the relative gain error over phases
    full_scale_a: float
    bits: int
    filter_order: int
    filter_share: float  # corner of the anti-alias filter as a share of the sampling rate
    reported_filter_hz: float  # corner of the filter of the drive's own current report
    reported_noise_a: float
    temperature_resolution_c: float


@dataclass(frozen=True)
class Damage:
    """Flexspline teeth ground away over a share of the perimeter.

    `severity` 0 is a healthy gear; 1 leaves the sector's teeth with the whole `gap_rad` of play
    and without the share `stiffness_loss` of their stiffness.
    """

    severity: float = 0.0
    share: float = 0.25
    gap_rad: float = 0.0  # play of one mesh zone at severity 1, joint side
    stiffness_loss: float = 0.0
    gap_shared: float = 0.0  # share of the play that the opposite zone gains: the ring shifts
    closing: float = 0.0  # play closed per wind-up of the loaded mesh, rad per rad
    zone_half_width_rad: float = 0.3  # half the arc of one mesh zone


@dataclass(frozen=True)
class SessionSpread:
    """Standard deviations of what differs from one recording session to the next."""

    temperature_c: float
    friction: float  # relative, common to Coulomb and viscous
    viscous: float  # relative, viscous alone
    sensor_gain: float  # relative
    sensor_offset_a: float
    kinematic_error: float  # relative, amplitude
    remount: bool  # a new angle of the wave generator and the flexspline per session


@dataclass(frozen=True)
class Effect:
    """One undeclared effect on one axis: a name of the design's list, a size, parameters.

    Sizes of torque effects are in ampere of motor current (per the unit of the regressor), as
    that is what an undeclared effect looks like to whoever models the current.
    """

    name: str
    axis: int
    magnitude: float
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Robot:
    """The arm: its joints, its current sensors, and how sessions differ."""

    name: str
    joints: tuple[Joint, ...]
    sensor: Sensor
    spread: SessionSpread
    electrical_hz_full_speed: float
    damage: Damage  # what severity 1 means on this robot; the severity here is ignored
