"""What sensors add to the current vector is taken out of it."""

import numpy as np

from opamc_cli.signal.plausible.sensor_errors import rounded, without_sensor_errors


def test_zero_errors_and_unequal_gains_are_taken_out_of_the_vector():
    angle = np.linspace(0, 300, 5000)
    torque = 2 + np.sin(angle / 40)
    clean = torque * np.exp(1j * angle)
    vector = clean + (0.1 - 0.2j) + (0.03 + 0.02j) * np.conj(clean)
    every = np.ones(angle.size, dtype=bool)
    mended = without_sensor_errors(vector, angle, every)
    assert np.std(np.angle(vector * np.exp(-1j * angle))) > 0.05
    assert np.std(np.angle(mended * np.exp(-1j * angle))) < 0.005
    assert without_sensor_errors(vector, angle, ~every) is vector


def test_a_vector_that_turns_often_tells_the_errors_without_its_angle():
    time = np.arange(40_000) / 2000
    angle = np.cumsum(0.3 * np.sin(time))
    angle[8000:12_000] = angle[8000]
    torque = (2 + np.sin(angle / 40)) * np.sign(np.cos(time))
    clean = torque * np.exp(1j * angle)

    def sway(vector):
        return np.abs(np.angle((vector * np.exp(-1j * angle)) ** 2)) / 2

    with_errors = clean + (3 - 4j) + (0.3 - 0.4j) * np.conj(clean)
    assert np.median(sway(with_errors)) > 0.5
    assert np.max(sway(rounded(with_errors))) < 0.05


def test_no_current_is_no_error():
    assert not rounded(np.zeros(100, dtype=complex)).any()
