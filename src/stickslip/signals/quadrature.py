"""The answer of a linear filter's poles, by quadrature from edge to edge. Compiled."""

from __future__ import annotations

import cmath

from stickslip.compiled import FAST, compiled

ALIKE = 1e-9  # of its length: an interval that differs by less from the one before has the same factors


@compiled(**FAST)
def follow(filter_, edges, ends, forced, rule, factors, out):
    """Add to `out` what the poles answer at the edges numbered `ends`.

    `filter_` holds poles, residues, and the poles' states at the first edge, which become those at the last end;
    `forced` (K, n) the input in each interval between edges, at the nodes of the `rule`: shares of its length, and
    weights. `factors` (n,) is scratch.
    """
    poles, residues, states = filter_
    nodes, weights = rule
    for p in range(len(poles)):
        pole, residue, state = poles[p], residues[p], states[p]
        if pole.imag < 0.0:
            continue  # its conjugate speaks for both
        if pole.imag > 0.0:
            residue *= 2.0
        known, decay, k = -1.0, state, 0
        for e in range(len(ends)):
            while k < ends[e]:
                length = edges[k + 1] - edges[k]
                if abs(length - known) > ALIKE * known:
                    known, decay = length, cmath.exp(pole * length)
                    for q in range(len(nodes)):
                        factors[q] = weights[q] * length * cmath.exp(pole * (length * (1.0 - nodes[q])))
                state *= decay
                for q in range(len(nodes)):
                    state += factors[q] * forced[k, q]
                k += 1
            out[e] += (residue * state).real
        states[p] = state
