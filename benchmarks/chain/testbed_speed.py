"""How much faster than real time the testbed is: six axes, 18 phase currents, 2048 Hz.

    python benchmarks/chain/testbed_speed.py [--jobs 2] [--quick]

Times the simulation alone on one core, and whole `opamc simulate` sessions (with files) on
`--jobs` worker processes.
"""

import argparse
import tempfile
import time
from pathlib import Path

from opamc_cli.config.testbed import load_testbed
from opamc_cli.stages.recordings import simulate as stage
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).parents[2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--sessions", type=int, default=8)
    parser.add_argument("--quick", action="store_true", help="two sessions")
    arguments = parser.parse_args()
    sessions = 2 if arguments.quick else arguments.sessions
    testbed = load_testbed(
        ROOT / "configs" / "testbed.yaml",
        [f"recording.sessions={sessions}", "faults=[{axis: 3}]", "program.cycles=16"],
    )
    faults = {3: testbed.robot.damage}
    simulate(testbed.robot, testbed.program, seed=0, axes=[3], faults=faults)  # compiles
    start = time.process_time()  # what others do on this machine does not count
    recording = simulate(testbed.robot, testbed.program, seed=0, faults=faults)
    taken = time.process_time() - start
    length = len(recording.axes[1].iq_a) / recording.sampling_rate_hz
    print(
        f"simulation alone, one core: {length:.0f} s in {taken:.2f} s, "
        f"{length / taken:.0f} x real time"
    )
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        stage.run(testbed, 0, Path(folder), truth_signals=False, jobs=arguments.jobs)
        taken = time.perf_counter() - start
    total = length * sessions
    print(
        f"{sessions} sessions with files, {arguments.jobs} workers (their start included): "
        f"{total:.0f} s in {taken:.1f} s, {total / taken:.0f} x real time"
    )


if __name__ == "__main__":
    main()
