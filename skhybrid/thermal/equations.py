"""Heat balance of every node of a network as text or LaTeX, in the paper's form."""

from __future__ import annotations

from collections.abc import Iterable

from .declaration import Declaration, Source, as_names


def equations(network: Declaration, roles: Iterable[str] | None = None, *, latex: bool = False) -> str:
    """One line per node: ``C dT/dt`` = conduction + sources."""
    roles = network.usual_roles if roles is None else as_names(roles)
    lines = []
    for node, capacitance in network.capacitances.items():
        flows = " + ".join([*_conduction(network, node, latex), *heat_inputs(network, node, roles, latex=latex)])
        rate = (
            rf"{symbol(capacitance)} \frac{{dT{_subscript(node)}}}{{dt}} &" if latex else f"{capacitance} dT_{node}/dt "
        )
        lines.append(f"{rate}= {flows}")
    return (" \\\\\n" if latex else "\n").join(lines)


def _conduction(network: Declaration, node: str, latex: bool) -> list[str]:
    """Heat flows into a node through its resistors."""
    flows = []
    for name, ends in network.resistors.items():
        if node in ends:
            other = ends[1] if ends[0] == node else ends[0]
            there, here = (f"T_{other}" if other in network.capacitances else other), f"T_{node}"
            fraction = rf"\frac{{{symbol(there)} - {symbol(here)}}}{{{symbol(name)}}}"
            flows.append(fraction if latex else f"({there} - {here})/{name}")
    return flows


def heat_inputs(network: Declaration, node: str, roles: Iterable[str], *, latex: bool = False) -> list[str]:
    """Heat flows into a node from its sources, the unmeasured one last."""
    flows = [_product(source, node, latex) for source in network.sources(roles) if node in dict(source.shares)]
    gains = dict(zip(network.disturbed_nodes, network.disturbed_names, strict=True))
    if node in gains:
        gain = "Q_g" if len(gains) == 1 else f"Q_g_{gains[node]}"
        flows.append(symbol(gain) if latex else gain)
    return flows


def _product(source: Source, node: str, latex: bool) -> str:
    """Heat of one source into a node, such as ``(1 - f) A_win q_sol``."""
    show = symbol if latex else str
    shares = dict(source.shares)
    factors = [] if shares[node] is None else [show(str(shares[node]))]
    named = [show(fraction) for fraction in shares.values() if fraction is not None]
    if shares[node] is None and named:
        factors.append(f"(1 - {' - '.join(named)})")
    factors += [show(name) for name in (source.parameter, source.role) if name is not None]
    return " ".join(factors)


def symbol(name: str) -> str:
    """A name such as ``R_zo`` in LaTeX; everything after the first underscore becomes the subscript."""
    head, _, rest = name.partition("_")
    return head + _subscript(rest) if rest else head


def _subscript(rest: str) -> str:
    return rf"_{{\mathrm{{{rest.replace('_', ',')}}}}}"
