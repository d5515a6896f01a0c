"""The heat balance of every node of a network, as text or LaTeX, in the paper's form."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .network import RCNetwork, Source


def equations(network: RCNetwork, roles: Iterable[str] | None = None, *, latex: bool = False) -> str:
    """One line a node: ``C dT/dt`` = conduction + sources."""
    roles = tuple(network.usual_roles if roles is None else roles)
    lines = []
    for node, capacitance in network.capacitances.items():
        terms = [*_conduction(network, node, latex), *heat_terms(network, node, roles, latex=latex)]
        if latex:
            lines.append(rf"{symbol(capacitance)} \dot{{T}}{_below(node)} &= {' + '.join(terms)}")
        else:
            lines.append(f"{capacitance} dT_{node}/dt = {' + '.join(terms)}")
    return (" \\\\\n" if latex else "\n").join(lines)


def _conduction(network: RCNetwork, node: str, latex: bool) -> list[str]:
    terms = []
    for name, ends in network.resistors.items():
        if node in ends:
            other = ends[1] if ends[0] == node else ends[0]
            there, here = (f"T_{other}" if other in network.capacitances else other), f"T_{node}"
            if latex:
                terms.append(rf"\frac{{{symbol(there)} - {symbol(here)}}}{{{symbol(name)}}}")
            else:
                terms.append(f"({there} - {here})/{name}")
    return terms


def heat_terms(network: RCNetwork, node: str, roles: Iterable[str], *, latex: bool = False) -> list[str]:
    """Heat into a node by every source, the unmeasured one last."""
    terms = [_product(source, node, latex) for source in network.sources(roles) if node in dict(source.shares)]
    if node in network.disturbed_nodes:
        gain = "Q_g" if len(network.disturbed_nodes) == 1 else f"Q_g_{node}"
        terms.append(symbol(gain) if latex else gain)
    return terms


def _product(source: Source, node: str, latex: bool) -> str:
    show = symbol if latex else str
    shares = dict(source.shares)
    factors = [] if shares[node] is None else [show(str(shares[node]))]
    named = [show(fraction) for fraction in shares.values() if fraction is not None]
    if shares[node] is None and named:
        factors.append(f"(1 - {' - '.join(named)})")
    factors += [show(name) for name in (source.parameter, source.role) if name is not None]
    return " ".join(factors)


def symbol(name: str) -> str:
    """A name such as ``R_zo`` in LaTeX, with all that follows the first underscore below."""
    head, _, rest = name.partition("_")
    return head + _below(rest) if rest else head


def _below(rest: str) -> str:
    return rf"_{{\mathrm{{{rest.replace('_', ',')}}}}}"
