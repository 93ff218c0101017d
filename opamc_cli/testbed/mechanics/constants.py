"""The kernel's constants from the robot's parameters, a session and a damage."""

from math import cos, exp, inf, pi, sin, sqrt

from opamc_cli.testbed.mechanics.kernel import AxisConstants
from opamc_cli.testbed.parameters import Damage, Joint, Sensor
from opamc_cli.testbed.session import AxisSession

GRAVITY_M_S2 = 9.80665


def axis_constants(
    joint: Joint,
    sensor: Sensor,
    session: AxisSession,
    damage: Damage,
    *,
    payload_kg: float,
    start_rad: float,
    sampling_rate_hz: float,
    controls_per_sample: int,
    steps_per_control: int,
) -> dict[str, float]:
    """Return the constants of one axis in one session, by the names of `AxisConstants`.

    The joint rests at `start_rad` at the start. Also `payload_inertia_per_kg` and
    `payload_gravity_per_kg`, for a change of payload.
    """
    control_hz = sampling_rate_hz * controls_per_sample
    constants = _physical(joint, session, damage, payload_kg, start_rad)
    constants["step_s"] = 1.0 / (control_hz * steps_per_control)
    constants["steps_per_control"] = steps_per_control
    constants["controls_per_sample"] = controls_per_sample
    constants.update(_digital(joint, sensor, constants, control_hz))
    return constants


def _physical(
    joint: Joint, session: AxisSession, damage: Damage, payload_kg: float, start_rad: float
) -> dict[str, float]:
    motor, gear, friction, link = joint.motor, joint.gear, joint.friction, joint.link
    arm = link.payload_arm_m
    inertia_per_kg = arm**2
    gravity_per_kg = link.payload_gravity_share * GRAVITY_M_S2 * arm
    link_inertia = link.inertia_kgm2 + payload_kg * inertia_per_kg
    gravity = link.gravity_torque_nm + payload_kg * gravity_per_kg
    load = gravity * sin(start_rad - link.gravity_angle_rad)
    mount, error = session.mount_rad, session.error
    windup = load / gear.stiffness_nm_per_rad
    constants: dict[str, float] = dict.fromkeys(AxisConstants._fields, 0.0)
    constants.update(
        pole_pairs=float(motor.pole_pairs),
        torque_constant=motor.torque_constant_nm_per_a,
        motor_inertia=motor.inertia_kgm2,
        resistance=motor.resistance_ohm,
        inductance=motor.inductance_h,
        phase_voltage=motor.bus_voltage_v / sqrt(3.0),
        current_limit=motor.current_limit_a,
        cogging_order=motor.cogging_order,
        cogging_torque=motor.cogging_torque_nm,
        ratio=gear.ratio,
        stiffness=gear.stiffness_nm_per_rad,
        stiffening=gear.stiffening_nm_per_rad3,
        damping=gear.damping_nms_per_rad,
        hysteresis_torque=gear.hysteresis_torque_nm,
        hysteresis_width=gear.hysteresis_width_rad,
        error_2c=gear.error_2_circular_rad * error,
        error_4c_sin=gear.error_4_circular_rad * error * cos(mount[1]),
        error_4c_cos=gear.error_4_circular_rad * error * sin(mount[1]),
        error_2f=gear.error_2_flexspline_rad * error,
        error_4f_sin=gear.error_4_flexspline_rad * error * cos(mount[3]),
        error_4f_cos=gear.error_4_flexspline_rad * error * sin(mount[3]),
        phase_2c=mount[0],
        phase_2f=mount[2],
        tooth_mesh_order=2.0 * gear.ratio + 2.0,  # teeth of the circular spline
        tooth_mesh_torque=gear.tooth_mesh_torque_nm,
        severity=damage.severity,
        half_sector=pi * damage.share,
        half_zone=damage.zone_half_width_rad,
        half_play=0.5 * damage.gap_rad,
        stiffness_loss=damage.stiffness_loss,
        play_shared=damage.gap_shared,
        closing=damage.closing,
        sector_angle=mount[4],
        coulomb=friction.coulomb_nm * session.friction,
        viscous=friction.viscous_nms_per_rad * session.friction * session.viscous,
        stribeck=friction.stribeck_nm * session.friction,
        stribeck_velocity=friction.stribeck_velocity_rad_s,
        smoothing_velocity=friction.smoothing_velocity_rad_s,
        load_coefficient=friction.load_coefficient,
        viscous_per_kelvin=friction.viscous_per_kelvin,
        coulomb_per_kelvin=friction.coulomb_per_kelvin,
        output_coulomb=friction.output_coulomb_nm,
        output_viscous=friction.output_viscous_nms_per_rad,
        link_inertia=link_inertia,
        gravity=gravity,
        late_link_inertia=link_inertia,
        late_gravity=gravity,
        payload_change_s=inf,
        payload_inertia_per_kg=inertia_per_kg,
        payload_gravity_per_kg=gravity_per_kg,
        gravity_angle=link.gravity_angle_rad,
        ambient_c=joint.thermal.ambient_c,
        start_c=session.temperature_c,
        heat_resistance=joint.thermal.resistance_k_per_w,
        heat_time=joint.thermal.time_constant_s,
        start_joint=start_rad - windup,
        start_motor=start_rad * gear.ratio,
        start_current=load / gear.ratio / motor.torque_constant_nm_per_a,
        fx_stribeck_velocity=1.0,
        fx_warmup_time=1.0,
        fx_drag_width=1.0,
        fx_hysteresis_width=1.0,
    )
    return constants


def _digital(
    joint: Joint, sensor: Sensor, constants: dict[str, float], control_hz: float
) -> dict[str, float]:
    """Return the controller's and the drive's constants; these know the nominal robot only."""
    motor, control, friction = joint.motor, joint.control, joint.friction
    ratio, k = joint.gear.ratio, joint.motor.torque_constant_nm_per_a
    inertia = motor.inertia_kgm2 + constants["link_inertia"] / ratio**2
    gain = 2.0 * pi * control.velocity_bandwidth_hz * inertia / k
    step_s = constants["step_s"]
    counts = control.encoder_counts_per_turn
    return {
        "position_gain": control.position_gain_per_s,
        "velocity_gain": gain,
        "velocity_integral": gain / control.velocity_integral_time_s,
        "current_blend": 1.0 - exp(-2.0 * pi * control.current_bandwidth_hz * step_s),
        "velocity_blend": 1.0 - exp(-2.0 * pi * control.velocity_filter_hz / control_hz),
        "encoder_step": 2.0 * pi / counts if counts else 0.0,
        "feed_inertia": control.inertia_feedforward * inertia * ratio / k,
        "feed_coulomb": control.friction_feedforward * friction.coulomb_nm / k,
        "feed_viscous": control.friction_feedforward * friction.viscous_nms_per_rad * ratio / k,
        "feed_gravity": control.gravity_feedforward * constants["gravity"] / ratio / k,
        "report_blend": 1.0 - exp(-2.0 * pi * sensor.reported_filter_hz * step_s),
    }
