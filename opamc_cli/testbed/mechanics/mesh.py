"""Torque of the strain wave gear's mesh: two zones, each a stiffening spring with play.

The wave generator presses the flexspline's teeth into the circular spline at the two ends of its
long axis. Each zone carries half the stiffness. Ground teeth give a zone play and cost it
stiffness while it lies over the damaged sector, which it does once per turn of the wave
generator relative to the flexspline: with two zones the fault's fundamental is 2 (N + 1) / N per
motor turn (output on the flexspline, circular spline fixed).

All torques are derivatives of one potential of the two shaft angles, so that neither kinematic
error nor play creates energy.
"""

from math import floor, pi

from numba import njit

_TWO_PI = 2.0 * pi


@njit(cache=True, nogil=True, inline="always")
def damaged_share(
    angle_rad: float, half_sector_rad: float, half_zone_rad: float
) -> tuple[float, float]:
    """Share of a mesh zone that lies over the damaged sector, and its derivative.

    Parameters
    ----------
    angle_rad : float
        Angle of the zone's centre from the sector's centre, any turn.
    half_sector_rad, half_zone_rad : float
        Half the sector's and half the zone's arc.

    Returns
    -------
    share : float
        0..1, smooth in the angle.
    slope : float
        Its derivative with respect to the angle, 1/rad.
    """
    wrapped = angle_rad - _TWO_PI * floor(angle_rad / _TWO_PI + 0.5)
    sign = 1.0
    if wrapped < 0.0:
        wrapped, sign = -wrapped, -1.0
    ramp = 2.0 * min(half_sector_rad, half_zone_rad)
    most = min(1.0, half_sector_rad / half_zone_rad)  # a zone may be longer than the sector
    x = (half_sector_rad + half_zone_rad - wrapped) / ramp
    if x <= 0.0:
        return 0.0, 0.0
    if x >= 1.0:
        return most, 0.0
    return most * x * x * (3.0 - 2.0 * x), -sign * most * 6.0 * x * (1.0 - x) / ramp


@njit(cache=True, nogil=True, inline="always")
def zone_torque(
    windup_rad: float,
    half_play_rad: float,
    closing: float,
    weight: float,
    stiffness: float,
    stiffening: float,
) -> tuple[float, float, float]:
    """Torque of one mesh zone with play that its own wind-up closes.

    Under load the neighbours of the ground teeth deflect, more pairs come into mesh and the
    stumps are pressed into their gaps: the play shrinks by `closing` per radian of wind-up.

    Parameters
    ----------
    windup_rad : float
        Wind-up of the joint, rad.
    half_play_rad : float
        Half the zone's play without load, rad.
    closing : float
        Play closed per wind-up, 0 or more.
    weight : float
        The zone's share of the stiffness.
    stiffness, stiffening : float
        Of the whole mesh, N.m/rad and N.m/rad^3.

    Returns
    -------
    torque_nm : float
        Derivative of the zone's energy by the wind-up.
    play_torque_nm : float
        Derivative of its energy by the half play.
    energy_per_weight_j : float
        Energy over weight: derivative of its energy by the weight.
    """
    size = abs(windup_rad)
    half = half_play_rad - closing * size
    gain = 1.0
    if half > 0.0:
        depth = size - half
        gain += closing
    else:
        depth = size
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    square = depth * depth
    force = weight * depth * (stiffness + stiffening * square)
    energy = square * (0.5 * stiffness + 0.25 * stiffening * square)
    signed = gain * force if windup_rad > 0.0 else -gain * force
    return signed, (-force if half > 0.0 else 0.0), energy
