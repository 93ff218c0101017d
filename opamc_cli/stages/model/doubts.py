"""What the names of a closed loop may stand for instead: notes, and doubts."""

from collections.abc import Sequence
from itertools import count, pairwise, takewhile

import numpy as np

from opamc_cli.joint.fit.intervals import Certainty
from opamc_cli.joint.fit.model import Fit, Term
from opamc_cli.joint.loop import Loop
from opamc_cli.joint.name.chain import HALF, chain_of, without
from opamc_cli.joint.name.search import LEAST_SHARE
from opamc_cli.stages.model.axis_model import AxisModel
from opamc_cli.stages.recordings.mistaken import scaled
from opamc_cli.storage.runs.run import Run

LIKE_ANOTHER_JOINT = {
    "hysteresis", "payload_change", "position_drag", "quadratic_friction", "ripple", "spring",
    "stribeck", "time_delay",
}  # fmt: skip
"""What the motion of other joints was called where they were not logged: 12 of 18 such programs of
three arms whose joints all move."""

SLOWEST_ORDERS = {"motor": 1.0, "joint": 30.0}
"""A motor's turn, per turn of the angle that is known: no strain wave gear's ratio is less."""

ALONE = (
    "axis {}: no other joint is logged, and what one that moves in time with it asks, or what "
    "comes back in every cycle and the library lacks, would look like {}; log it beside to tell"
)

ONE_PROGRAM = (
    "axis {}: which of the other joints load it, and what of that is an effect of its own, one "
    "program does not tell for certain; tell where the arm's joints are (`arm` in model.yaml), or "
    "close it on several programs at once"
)

OF_THE_PLACE = {
    "gravity", "hysteresis", "load_friction", "payload_change", "position_drag", "ripple", "spring",
}  # fmt: skip

DOUBTED = (
    "axis {}: {} may be wrong: the place, which is behind it, is a guess where no current was seen "
    "(gaps: {}, {:.1f} s in all); log the position to be certain"
)

DRIVES = (
    "axis {}: the declared {} drives the joint instead of resisting: it makes up for something "
    "that the model lacks"
)

BELOW_0 = (
    "axis {}: the declared inertia is below 0: it makes up for something that the model lacks, or "
    "the current has the opposite sign of the motion"
)

ONE = (
    "axis {}: on this motion {} are one: their sum is known, each holds a part of it by chance; "
    "record it both ways and at other speeds before their values are used"
)

CANCEL = (
    "axis {}: {} nearly cancel, each {:g} times the current's spread or more: over this travel "
    "they are as one function, whose name is a guess; declare nothing that the joint lacks, or "
    "move it further"
)

CANCELS = 3.0
"""Spreads of the current from which on what an effect adds is there to cancel another."""

UNMISSED = "axis {}: the sealed data do not miss {}: a guess until another recording shows it, too"

COPIES = (
    "axis {}: the motion repeats itself, and a cycle has {:.0f} samples that count, to which {} "
    "numbers were fitted: the sealed cycles are copies, which refute no name ({}); close it on "
    "another program, too, or log it faster"
)

COPIED = 5.0
"""Samples of a cycle for each number that was fitted, fewer of which describe that cycle alone: on
a screw's steps five names, all wrong, had 0.7; of 16 simulated joints' right ones the least 19."""

UNTOLD = (
    "axis {}: a weight and an inertia of each run's own would take {:.0%} off the squared error "
    "that is left: where they carry different payloads, tell payload_kg in their metadata"
)

ONCE = (
    "axis {}: no place is passed twice the same way, so friction at one may be whatever came at "
    "that time"
)

FROM_ONE_ON = (
    "axis {}: payload_change is what differs from recording {} on: another program, controller or "
    "mounting there would look like it"
)

AT_THE_START = 0.05
"""Share of a recording by which a payload's time may miss its start: a true one ends 0.006 off."""

ONE_TURN = (
    "axis {}: ripples of orders {} are multiples of the first: rather something that happens once "
    "in its turn, as where a brake rubs or a tooth is damaged, than a source for each"
)

SAME_ORDER = 0.01
"""By which a multiple may miss: of 384 closings of strangers' joints two have three in a row, both
of brakes that rub."""

ANGLE = "joint-angle"

DRIVEN_T = 6.0
"""Errors by which a closed model's friction drives where its current has the opposite sign: of 46
joints of arms that move all of them six did so, by 11 to 161; the least of the others by 3. So
does a declared friction whose searched parameters make up for another (one of 39, by 108)."""

INERTIA_T = 9.0
"""Errors by which its inertia is below 0 there: a measured one by 13; of 40 others the least by 2,
of seven more by 6. It is doubted by `DRIVEN_T` errors: of 268 closed ones none is by 3."""


def doubts_of(
    laid: AxisModel, loop: Loop, sure: Certainty, runs: Sequence[Run]
) -> tuple[list[str], list[str]]:
    """Say of a closed loop's names which may stand for something else.

    Parameters
    ----------
    laid, runs
        What was closed.
    loop, sure
        What was found, and how certain its coefficients are.

    Returns
    -------
    list of str
        What is worth knowing.
    list of str
        Which names, or recordings, are rather wrong than right.
    """
    axis, track = laid.axis, loop.after.dataset.fine.track
    found = {step.term.effect.name for step in loop.steps}
    notes: list[str] = []
    doubts: list[str] = []
    if (placed := sorted(found & OF_THE_PLACE)) and (gaps := track.guessed_s):
        doubts.append(DOUBTED.format(axis, " and ".join(placed), len(gaps), sum(gaps)))
    # Coulomb is a part of the dry friction beside it.
    built_up = sum(
        float(values[0])
        for term, values in zip(loop.after.terms, loop.after.coefficients, strict=True)
        if term.effect.builds_up
    )
    declared = zip(loop.before.terms, loop.after.coefficients, sure.standard_errors, strict=False)
    for term, values, errors in declared:
        resists = term.effect.resists and not term.effect.at_a_place
        drag = values[0] + built_up * (term.effect.name == "coulomb")
        if resists and drag < -DRIVEN_T * errors[0]:
            given = "; check its parameters, or give them" if term.parameters else ""
            doubts.append(DRIVES.format(axis, term.effect.name) + given)
        if term.effect.name == "inertia" and values[0] < -DRIVEN_T * errors[0]:
            doubts.append(BELOW_0.format(axis))
    orders = [step.term.parameters["order"] for step in loop.steps if _is_ripple(step.term)]
    if family := one_turn(orders):
        doubts.append(ONE_TURN.format(axis, ", ".join(f"{order:.4g}" for order in family)))
    if unmissed := _unmissed(loop):
        doubts.append(UNMISSED.format(axis, ", ".join(unmissed)))
    own, fitted = _of_a_cycle(loop)
    called = ", ".join(_called(step.term) for step in loop.steps if step.named)
    if called and own < COPIED * fitted:
        doubts.append(COPIES.format(axis, own, fitted, called))
    cancelling = _cancelling(loop.after)
    if len(cancelling) > 1 and found & set(cancelling):
        doubts.append(CANCEL.format(axis, " and ".join(cancelling), CANCELS))
    for names in sure.one:
        known = [name for name in names if not name.startswith("unnamed")]
        if len(known) > 1:
            notes.append(ONE.format(axis, " and ".join(known)))
    if track.payload_kg is None and (share := _loads_of_runs(loop.after)) > HALF:
        notes.append(UNTOLD.format(axis, share))
    if "position_drag" in found and "revisits" not in track.channels:
        notes.append(ONCE.format(axis))
    begun = _begins_with(loop, [one.name for one in laid.read.recordings])
    if begun is not None:
        notes.append(FROM_ONE_ON.format(axis, begun))
    # What follows the payloads that each run tells follows no other joint.
    told = {step.term.effect.name for step in loop.steps if "per_kg" in step.term.parameters}
    named = sorted((found - told) & LIKE_ANOTHER_JOINT)
    if named and not any(one.others_rad for one in laid.read.recordings):
        slowest = SLOWEST_ORDERS.get(track.angle_kind, 0.0)
        unlikely = any(_of_the_program(step.term, slowest) for step in loop.steps)
        (doubts if unlikely else notes).append(ALONE.format(axis, ", ".join(named)))
    linked = "coupling" in found.union(*(step.ties for step in loop.steps))
    if len(runs) == 1 and (linked or "coupling" in {t.effect.name for t in loop.before.terms}):
        # Of six programs that repeat themselves three named a wrong joint, of eight others none.
        doubted = linked and (np.isfinite(track.period_s) or not loop.predicts)
        (doubts if doubted else notes).append(ONE_PROGRAM.format(axis))
    if any(e.unnamed and e.domain == ANGLE for e in (step.term.effect for step in loop.steps)):
        by_name = {one.name: one for one in laid.read.recordings}
        doubts += [note for run in runs for note in scaled(run, axis, by_name[run.name])]
    return notes, doubts


def _loads_of_runs(closed: Fit) -> float:
    """Share of the error that is left that each of several runs' own weight and inertia take."""
    grid = closed.dataset.fine
    track, rows = grid.track, grid.parts.rows
    began = np.round(track.time_s - track.run_time_s, 3)[rows]
    left, place, own = closed.residual_a[rows], track.position_rad[rows], np.zeros(rows.size)
    loads = np.stack([np.sin(place), np.cos(place), track.acceleration[rows]], axis=1)
    starts = np.unique(began)
    for start in starts if starts.size > 1 else ():
        inside = began == start
        own[inside] = loads[inside] @ np.linalg.lstsq(loads[inside], left[inside])[0]
    return float(own @ left) / max(float(left @ left), 1e-300)


def _cancelling(closed: Fit) -> list[str]:
    """Name the effects of the place that add far more than the current has, each against others."""
    dataset, grid = closed.dataset, closed.dataset.fine
    spread = float(np.std(grid.track.current_a[grid.parts.rows]))
    added = {
        term.effect.name: np.std(grid.parts.taken(dataset.columns(term, fine=True)) @ values)
        for term, values in zip(closed.terms, closed.coefficients, strict=True)
        if term.effect.domain == ANGLE
    }
    return sorted(name for name, size in added.items() if size > CANCELS * spread)


def _of_a_cycle(loop: Loop) -> tuple[float, int]:
    """Return the open samples of a cycle, infinite without one, and how many numbers were fitted.

    Cycles are left out in turn and sealed, each a copy of the others but for its noise: they tell a
    model from another only as long as one alone holds more samples than the model has numbers.
    """
    grid, terms = loop.after.dataset.fine, loop.after.terms
    numbers = sum(len(values) for values in loop.after.coefficients)
    numbers += sum(term.effect.searched(term.parameters) for term in terms)
    cycles = np.unique(grid.track.group[grid.parts.rows]).size
    repeats = np.isfinite(grid.track.period_s) and len(grid.track.starts_s) == 1
    return (grid.parts.rows.size / max(cycles, 1) if repeats else np.inf), numbers


def _begins_with(loop: Loop, names: Sequence[str]) -> str | None:
    """Name the recording with which a payload changes, within a twentieth of either beside it."""
    track = loop.after.dataset.fine.track
    edges_s = np.append(track.starts_s, track.time_s[-1])
    near_s = [AT_THE_START * min(pair) for pair in pairwise(np.diff(edges_s))]
    since = [step.term.parameters.get("since_s", np.inf) for step in loop.steps]
    for name, start_s, within_s in zip(names[1:], edges_s[1:], near_s, strict=False):
        if any(abs(since_s - start_s) < within_s for since_s in since):
            return name
    return None


def _unmissed(loop: Loop) -> list[str]:
    """Name the effects without which, beside all others, the sealed error is hardly larger.

    By less than a share of its square that is asked of an effect in the open data.
    """
    squared, found = loop.rmse_after_a**2, []
    closed = chain_of(loop.after, len(loop.steps))
    for place, step in enumerate(loop.steps):
        if step.named:
            rest = without(closed, place, rounds=1).fit.rmse(sealed=True)
            if squared > (1 - LEAST_SHARE) * rest**2:
                found.append(_called(step.term))
    return found


def one_turn(orders: Sequence[float]) -> list[float]:
    """Return one of some orders and its multiples in a row, if its second and third are there.

    What happens at one angle of a turn is a sum of such lines; kinematic errors and eccentricity
    have orders 1, 2 and 4.
    """
    for first in sorted(orders):
        times = ((round(order / first), order) for order in orders)
        family = {k: one for k, one in times if abs(one / first - k) < SAME_ORDER * k}
        in_a_row = list(takewhile(family.__contains__, count(1)))
        if len(in_a_row) > 2:
            return [family[k] for k in in_a_row]
    return []


def _is_ripple(term: Term) -> bool:
    return term.effect.name == "ripple"


def _called(term: Term) -> str:
    """Name an effect that a joint may have several times."""
    if "order" in term.parameters:
        return f"{term.effect.name} of order {term.parameters['order']:.4g}"
    axes = [f"{term.parameters[key]:g}" for key in ("axis", "beside") if key in term.parameters]
    return term.effect.name + f" with {' and '.join(axes)}" * bool(axes)


def _of_the_program(term: Term, slowest: float) -> bool:
    """Tell whether a name follows the program as another joint would, and no gear does.

    A payload that is held in a part of every cycle, or a line slower than the motor turns, where a
    joint's own are one to its turn or two.
    """
    if term.effect.name == "payload_change":
        return "gripped_s" in term.parameters
    return _is_ripple(term) and term.parameters["order"] < slowest
