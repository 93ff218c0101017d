"""The compiled inner loop: one axis under field-oriented control, integrated in time.

States: motor angle and velocity, joint angle and velocity, i_q, the hysteresis variable, the
winding's temperature, and the controller's and filters' memories. Integration is semi-implicit
Euler at a fixed step of about 60 us, a hundredth of the period of the stiffest oscillation (the
two-mass resonance lies at 20 to 80 Hz), so the stiff spring stays stable; what decays faster (the
current loop) is integrated by its exact exponential.
"""

from math import cos, exp, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from opamc_cli.testbed.mechanics.mesh import damaged_share, zone_torque

SIGNALS = (
    "iq_a",
    "motor_angle_rad",
    "motor_velocity_rad_s",
    "joint_angle_rad",
    "joint_velocity_rad_s",
    "temperature_c",
    "alpha_a",
    "beta_a",
    "reported_a",
)
"""Columns of what `run_axis` returns."""


class AxisConstants(NamedTuple):
    """Everything constant during one run of one axis, SI units, motor side unless `joint`."""

    step_s: float
    steps_per_control: int
    controls_per_sample: int
    # motor and drive
    pole_pairs: float
    torque_constant: float
    motor_inertia: float
    resistance: float
    inductance: float
    phase_voltage: float
    current_limit: float
    cogging_order: float
    cogging_torque: float
    # control
    position_gain: float
    velocity_gain: float  # A per rad/s
    velocity_integral: float  # A per rad
    current_blend: float  # share of the current's error closed per step
    velocity_blend: float  # same for the velocity filter, per control period
    encoder_step: float  # rad, 0: none
    feed_inertia: float  # A per joint rad/s^2
    feed_coulomb: float  # A
    feed_viscous: float  # A per joint rad/s
    feed_gravity: float  # A
    # gear
    ratio: float
    stiffness: float  # joint
    stiffening: float  # joint
    damping: float  # joint
    hysteresis_torque: float  # joint
    hysteresis_width: float  # joint
    error_2c: float  # joint
    error_4c_sin: float
    error_4c_cos: float
    error_2f: float
    error_4f_sin: float
    error_4f_cos: float
    phase_2c: float
    phase_2f: float
    tooth_mesh_order: float
    tooth_mesh_torque: float
    # damage
    severity: float
    half_sector: float
    half_zone: float
    half_play: float  # joint
    stiffness_loss: float
    play_shared: float
    closing: float
    sector_angle: float
    # friction
    coulomb: float
    viscous: float
    stribeck: float
    stribeck_velocity: float
    smoothing_velocity: float
    load_coefficient: float
    viscous_per_kelvin: float
    coulomb_per_kelvin: float
    output_coulomb: float  # joint
    output_viscous: float  # joint
    # link, before and after the payload changes
    link_inertia: float  # joint
    gravity: float  # joint
    late_link_inertia: float
    late_gravity: float
    payload_change_s: float
    gravity_angle: float
    # heat
    ambient_c: float
    start_c: float
    heat_resistance: float
    heat_time: float
    # start
    start_joint: float
    start_motor: float
    start_current: float
    # the drive's own current report
    report_blend: float
    # undeclared effects, in ampere (per unit of the regressor)
    any_effect: bool
    fx_offset: float
    fx_gravity: float
    fx_gravity_angle: float
    fx_coulomb: float
    fx_viscous: float
    fx_stribeck: float
    fx_stribeck_velocity: float
    fx_quadratic: float
    fx_power: float
    fx_power_exponent: float
    fx_asymmetric: float
    fx_load: float
    fx_thermal: float
    fx_thermal_reference_c: float
    fx_warmup: float
    fx_warmup_time: float
    fx_spring: float
    fx_spring_angle: float
    fx_drag: float
    fx_drag_angle: float
    fx_drag_width: float
    fx_hysteresis: float
    fx_hysteresis_width: float
    fx_dead_time: float


@njit(cache=True, nogil=True)
def smooth_sign(value: float, width: float) -> float:
    """Sign that passes zero with slope 1 / width."""
    return value / sqrt(value * value + width * width)


@njit(cache=True, nogil=True)
def motor_friction(
    velocity: float,
    load: float,
    coulomb: float,
    viscous: float,
    stribeck: float,
    stribeck_velocity: float,
    smoothing_velocity: float,
    load_coefficient: float,
) -> float:
    """Friction torque at the wave generator: Coulomb, Stribeck, viscous, load dependent, N.m."""
    ratio = velocity / stribeck_velocity
    level = coulomb + load_coefficient * abs(load)
    if ratio * ratio < 30.0:
        level += stribeck * exp(-ratio * ratio)
    return level * smooth_sign(velocity, smoothing_velocity) + viscous * velocity


@njit(cache=True, nogil=True)
def _averaged(order: float, angle: float, velocity: float, step: float) -> float:
    """Mean of sin(order * angle) over one step: what turns faster than the step averages out."""
    half = 0.5 * order * velocity * step
    if abs(half) > 20.0:
        return 0.0
    if abs(half) < 1e-3:
        return sin(order * angle)
    return sin(order * angle) * sin(half) / half


@njit(cache=True, nogil=True)
def _effect_current(
    c: AxisConstants,
    time: float,
    joint: float,
    joint_velocity: float,
    load: float,
    temperature: float,
    hysteresis: float,
) -> float:
    """Sum of the undeclared torque effects that vary slowly, as current in A."""
    s = smooth_sign(joint_velocity, c.smoothing_velocity / c.ratio)
    speed = abs(joint_velocity)
    total = c.fx_offset + c.fx_gravity * sin(joint - c.fx_gravity_angle)
    total += s * (c.fx_coulomb + c.fx_quadratic * joint_velocity * joint_velocity)
    total += c.fx_viscous * joint_velocity + c.fx_asymmetric * abs(s)
    if c.fx_stribeck != 0.0:
        total += s * c.fx_stribeck * exp(-((joint_velocity / c.fx_stribeck_velocity) ** 2))
    if c.fx_power != 0.0:
        total += s * c.fx_power * speed**c.fx_power_exponent
    total += s * c.fx_load * abs(load)
    total += c.fx_thermal * (temperature - c.fx_thermal_reference_c) * joint_velocity
    if c.fx_warmup != 0.0:
        total += s * c.fx_warmup * exp(-time / c.fx_warmup_time)
    total += c.fx_spring * (joint - c.fx_spring_angle)
    if c.fx_drag != 0.0:
        total += s * c.fx_drag * exp(-0.5 * ((joint - c.fx_drag_angle) / c.fx_drag_width) ** 2)
    return total + c.fx_hysteresis * hysteresis


@njit(cache=True, nogil=True)
def _damaged_mesh(c: AxisConstants, windup: float, turn: float) -> tuple[float, float]:
    """Torque of both zones over a damaged flexspline, and the one that resists its turning."""
    here, here_slope = damaged_share(turn - c.sector_angle, c.half_sector, c.half_zone)
    there, there_slope = damaged_share(turn - c.sector_angle + pi, c.half_sector, c.half_zone)
    play = c.severity * c.half_play
    loss = 0.5 * c.severity * c.stiffness_loss
    first, first_play, first_energy = zone_torque(
        windup,
        play * (here + c.play_shared * there),
        c.closing,
        0.5 - loss * here,
        c.stiffness,
        c.stiffening,
    )
    second, second_play, second_energy = zone_torque(
        windup,
        play * (there + c.play_shared * here),
        c.closing,
        0.5 - loss * there,
        c.stiffness,
        c.stiffening,
    )
    turning = (
        first_play * play * (here_slope + c.play_shared * there_slope)
        + second_play * play * (there_slope + c.play_shared * here_slope)
        - loss * (first_energy * here_slope + second_energy * there_slope)
    )
    return first + second, turning


@njit(cache=True, nogil=True)
def _dead_time(alpha: float, beta: float, size: float) -> tuple[float, float]:
    """Return the current distortion of dead time: fifth, seventh and higher harmonics.

    Each phase's error has the sign of its current; the current loop takes out the fundamental,
    1.253 of the size (4 / pi were the sign's step not smoothed).
    """
    width = 0.1 * sqrt(alpha * alpha + beta * beta) + 1e-3
    a = smooth_sign(alpha, width)
    b = smooth_sign(-0.5 * alpha + 0.8660254037844386 * beta, width)
    d = smooth_sign(-0.5 * alpha - 0.8660254037844386 * beta, width)
    length = sqrt(alpha * alpha + beta * beta) + 1e-9
    da = -size * ((2.0 * a - b - d) / 3.0 - 1.2530003417165367 * alpha / length)
    db = -size * ((b - d) / 1.7320508075688772 - 1.2530003417165367 * beta / length)
    return da, db


@njit(cache=True, nogil=True)
def run_axis(
    c: AxisConstants,
    reference_position: NDArray[np.float64],
    reference_velocity: NDArray[np.float64],
    reference_acceleration: NDArray[np.float64],
    fluctuation: NDArray[np.float64],
    ripples: NDArray[np.float64],
    filter_sections: NDArray[np.float64],
    n_samples: int,
) -> NDArray[np.float64]:
    """Integrate one axis and return its signals at the sampling rate.

    Parameters
    ----------
    c : AxisConstants
    reference_position, reference_velocity, reference_acceleration : ndarray, shape (n_control,)
        Joint-side reference at the control rate.
    fluctuation : ndarray, shape (n_control,)
        Friction that does not repeat, motor side, N.m; acts only while the motor turns.
    ripples : ndarray, shape (k, 4)
        Undeclared ripples: order per motor turn, amplitude in A, phase in rad, exponent of the
        speed (relative to 1 rad/s of the motor; 0: constant).
    filter_sections : ndarray, shape (s, 6)
        The anti-alias filter as second-order sections at the step's rate.
    n_samples : int

    Returns
    -------
    ndarray, shape (n_samples, 9)
        Columns are `SIGNALS`: truth, the current vector behind the anti-alias filter, and i_q as
        the drive reports it. A row is the state at its sample's instant.
    """
    out = np.empty((n_samples, 9))
    n_sections = filter_sections.shape[0]
    memory = np.zeros((n_sections, 4))
    h = c.step_s
    n = c.ratio
    motor = c.start_motor
    joint = c.start_joint
    omega = 0.0
    joint_omega = 0.0
    current = c.start_current
    reported = current
    hysteresis = 0.0
    fx_hysteresis = 0.0
    temperature = c.start_c
    integral = current
    measured_before = motor
    velocity_estimate = 0.0
    command = current
    torque = 0.0
    effect = 0.0
    control_s = h * c.steps_per_control
    tick = 0
    viscous = c.viscous
    coulomb = c.coulomb
    stribeck = c.stribeck
    wobble = 0.0
    for i in range(n_samples):
        for _ in range(c.controls_per_sample):
            # ---- control period -------------------------------------------------------------
            measured = motor
            if c.encoder_step > 0.0:
                measured = np.floor(motor / c.encoder_step) * c.encoder_step
            velocity_estimate += c.velocity_blend * (
                (measured - measured_before) / control_s - velocity_estimate
            )
            measured_before = measured
            feed = (
                c.feed_inertia * reference_acceleration[tick]
                + c.feed_coulomb * smooth_sign(reference_velocity[tick], c.smoothing_velocity / n)
                + c.feed_viscous * reference_velocity[tick]
                + c.feed_gravity * sin(reference_position[tick] - c.gravity_angle)
            )
            velocity_error = (
                c.position_gain * (n * reference_position[tick] - measured)
                + n * reference_velocity[tick]
                - velocity_estimate
            )
            wanted = feed + c.velocity_gain * velocity_error + integral
            command = min(max(wanted, -c.current_limit), c.current_limit)
            if wanted == command:  # anti-windup: the integral waits while saturated
                integral += c.velocity_integral * velocity_error * control_s
            # heat, and the friction that depends on it
            loss = 1.5 * c.resistance * current * current + abs(
                viscous * omega * omega + coulomb * omega
            )
            temperature += (
                control_s * (c.ambient_c + c.heat_resistance * loss - temperature) / c.heat_time
            )
            warmer = temperature - 25.0
            viscous = c.viscous * exp(-c.viscous_per_kelvin * warmer)
            cold = exp(-c.coulomb_per_kelvin * warmer)
            coulomb = c.coulomb * cold
            stribeck = c.stribeck * cold
            wobble = fluctuation[tick]
            time = tick * control_s
            late = time >= c.payload_change_s
            link_inertia = c.late_link_inertia if late else c.link_inertia
            gravity = c.late_gravity if late else c.gravity
            if c.any_effect:
                fx_step = joint_omega * control_s / c.fx_hysteresis_width
                fx_hysteresis += fx_step - abs(fx_step) * fx_hysteresis
                effect = _effect_current(
                    c, time, joint, joint_omega, torque, temperature, fx_hysteresis
                )
            tick += 1
            for _ in range(c.steps_per_control):
                # ---- current loop ---------------------------------------------------------
                headroom = c.phase_voltage - abs(
                    c.torque_constant / 1.5 * omega + c.resistance * current
                )
                reach = max(headroom, 0.0) * h / c.inductance
                change = c.current_blend * (command - current)
                current += min(max(change, -reach), reach)
                # ---- mesh -----------------------------------------------------------------
                turn = motor + joint  # wave generator against the turning flexspline
                s2c, c2c = sin(2.0 * motor + c.phase_2c), cos(2.0 * motor + c.phase_2c)
                s2f, c2f = sin(2.0 * turn + c.phase_2f), cos(2.0 * turn + c.phase_2f)
                s4c, c4c = 2.0 * s2c * c2c, 1.0 - 2.0 * s2c * s2c  # the double angle
                s4f, c4f = 2.0 * s2f * c2f, 1.0 - 2.0 * s2f * s2f
                error = c.error_2c * s2c + c.error_4c_sin * s4c + c.error_4c_cos * c4c
                error += c.error_2f * s2f + c.error_4f_sin * s4f + c.error_4f_cos * c4f
                slope_f = 2.0 * c.error_2f * c2f + 4.0 * (
                    c.error_4f_sin * c4f - c.error_4f_cos * s4f
                )
                slope_m = (
                    slope_f
                    + 2.0 * c.error_2c * c2c
                    + 4.0 * (c.error_4c_sin * c4c - c.error_4c_cos * s4c)
                )
                windup = motor / n - joint - error
                if c.severity == 0.0:
                    torque = windup * (c.stiffness + c.stiffening * windup * windup)
                    turning = 0.0
                else:
                    torque, turning = _damaged_mesh(c, windup, turn)
                sliding = omega / n - joint_omega
                hysteresis_step = sliding * h / c.hysteresis_width
                hysteresis += hysteresis_step - abs(hysteresis_step) * hysteresis
                lossy = c.damping * sliding + c.hysteresis_torque * hysteresis
                # ---- motor ----------------------------------------------------------------
                friction = motor_friction(
                    omega,
                    torque,
                    coulomb,
                    viscous,
                    stribeck,
                    c.stribeck_velocity,
                    c.smoothing_velocity,
                    c.load_coefficient,
                )
                friction += wobble * abs(smooth_sign(omega, c.smoothing_velocity))
                friction += c.cogging_torque * _averaged(c.cogging_order, motor, omega, h)
                friction += c.tooth_mesh_torque * _averaged(c.tooth_mesh_order, motor, omega, h)
                if c.any_effect:
                    wave = effect
                    for k in range(ripples.shape[0]):
                        size = ripples[k, 1]
                        if ripples[k, 3] != 0.0:
                            size *= abs(omega) ** ripples[k, 3]
                        wave += size * sin(ripples[k, 0] * motor + ripples[k, 2])
                    friction += c.torque_constant * wave
                drive = c.torque_constant * current
                omega += (
                    h
                    / c.motor_inertia
                    * (drive - friction - torque * (1.0 / n - slope_m) - turning - lossy / n)
                )
                # ---- link -----------------------------------------------------------------
                drag = c.output_viscous * joint_omega + c.output_coulomb * smooth_sign(
                    joint_omega, c.smoothing_velocity / n
                )
                joint_omega += (
                    h
                    / link_inertia
                    * (
                        torque * (1.0 + slope_f)
                        - turning
                        + lossy
                        - drag
                        - gravity * sin(joint - c.gravity_angle)
                    )
                )
                motor += h * omega
                joint += h * joint_omega
                # ---- currents behind the anti-alias filter ----------------------------------
                angle = c.pole_pairs * motor
                ux, uy = -sin(angle), cos(angle)
                alpha, beta = current * ux, current * uy
                shown = current
                if c.fx_dead_time != 0.0:
                    da, db = _dead_time(alpha, beta, c.fx_dead_time)
                    alpha += da
                    beta += db
                    shown += da * ux + db * uy
                reported += c.report_blend * (shown - reported)
                for s in range(n_sections):
                    b0, b1, b2 = filter_sections[s, 0], filter_sections[s, 1], filter_sections[s, 2]
                    a1, a2 = filter_sections[s, 4], filter_sections[s, 5]
                    ya = b0 * alpha + memory[s, 0]
                    memory[s, 0] = b1 * alpha - a1 * ya + memory[s, 1]
                    memory[s, 1] = b2 * alpha - a2 * ya
                    yb = b0 * beta + memory[s, 2]
                    memory[s, 2] = b1 * beta - a1 * yb + memory[s, 3]
                    memory[s, 3] = b2 * beta - a2 * yb
                    alpha, beta = ya, yb
        out[i, 0] = current
        out[i, 1] = motor
        out[i, 2] = omega
        out[i, 3] = joint
        out[i, 4] = joint_omega
        out[i, 5] = temperature
        out[i, 6] = alpha
        out[i, 7] = beta
        out[i, 8] = reported
    return out
