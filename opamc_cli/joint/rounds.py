"""One round of the loop: a fit, what its residual may come from, and the fits that may follow."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.gate import Gate, decoy_likelihood
from opamc_cli.joint.model import Fit, fit_terms
from opamc_cli.joint.search import Candidate
from opamc_cli.joint.span import orthonormal_beside
from opamc_cli.joint.trace import Traced, trace_residual
from opamc_cli.joint.view import View, prepare


@dataclass(frozen=True)
class Rules:
    """By what all rounds of a loop choose: the library, the gate, and the decoys' generator."""

    library: Library
    gate: Gate
    generator: np.random.Generator


class Round:
    """A fit, and all that is found out about its residual, each once.

    Where an effect turns out to be an imitation the loop starts over without it, and comes by the
    same fits until the point where that effect had been added.

    Parameters
    ----------
    fitted : Fit
        The model so far.
    rules : Rules
        What to try.
    """

    def __init__(self, fitted: Fit, rules: Rules) -> None:
        self.fitted = fitted
        self._rules = rules
        self._traced: Traced | None = None
        self._views: dict[bool, View] = {}
        self._beside_decoys: dict[str, Candidate] = {}
        self._following: dict[str, Round] = {}

    def traced(self, imitations: Mapping[str, str]) -> Traced:
        """Weigh every effect's best form.

        Parameters
        ----------
        imitations : dict of str to str
            Effects whose forms have been found wrong, and why. They are not added again, but have
            been weighed: what is of their form is of a form that the library knows.
        """
        if self._traced is None:
            self._traced = trace_residual(self.fitted, self._rules.library, self._rules.gate)
            self._views = self._traced.views
        candidates = [
            replace(candidate, why_not=imitations[name], imitates=None)
            if (name := candidate.term.effect.name) in imitations
            else candidate
            for candidate in self._traced.candidates
        ]
        return replace(self._traced, candidates=candidates, views={})

    def beside_decoys(self, candidate: Candidate) -> Candidate:
        """Compare a candidate with decoys; they are costly: only for what passes all else."""
        name = candidate.term.effect.name
        if name not in self._beside_decoys:
            gate = self._rules.gate
            view = self._view(candidate.fine)
            enough = candidate.likelihood / gate.decoy_ratio
            decoy = decoy_likelihood(
                self.fitted, view, candidate, self._rules.generator, gate.decoys, enough
            )
            share = decoy / max(candidate.likelihood, 1e-300)
            tested = replace(candidate, decoy_gain=candidate.gain * share)
            if decoy > enough:
                tested = replace(tested, why_not="a decoy of the same form does half as well")
            self._beside_decoys[name] = tested
        return self._beside_decoys[name]

    def likelihood_among_fast(self, candidate: Candidate) -> float:
        """Likelihood of a slow candidate's form on the grid of the fast ones."""
        view = self._view(fine=True)
        columns = view.whitened_rows(self.fitted.session.columns(candidate.term, fine=True))
        own = orthonormal_beside(columns, view.span)
        left = view.power - float(np.sum((own.T @ view.values) ** 2))
        left = max(left, 1e-12 * view.power)
        return view.freedom(own.shape[1]) * float(np.log(view.power / left))

    def following(self, candidate: Candidate) -> "Round":
        """Fit the model that holds the candidate too; return its round."""
        name = candidate.term.effect.name
        if name not in self._following:
            terms = (*self.fitted.terms, candidate.term)
            extended = fit_terms(self.fitted.session, terms)
            self._following[name] = Round(extended, self._rules)
        return self._following[name]

    def rest(self) -> None:
        """Give back what takes most of the memory, and is computed again where it is needed."""
        self._views = {}
        if self._traced is not None:
            self._traced = replace(self._traced, views={})
        for grid in (self.fitted.session.fine, self.fitted.session.coarse):
            grid.track.forget()

    def _view(self, fine: bool) -> View:
        if fine not in self._views:
            self._views[fine] = prepare(self.fitted, fine)
        return self._views[fine]
