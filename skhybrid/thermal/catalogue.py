"""Catalogue of common networks, by name.

Bacher and Madsen's letters are nodes here: i (interior) is ``za``, e the envelope, m the medium (furniture, inner
walls), h the heater, s the sensor; their T_a is ``T_oa``.  Their areas of windows and envelope are ``A_win`` and its
share ``f``: A_w = f A_win, A_e = (1 - f) A_win.

Networks with a node without capacitance (5R1C of ISO 13790, 7R2C of VDI 6007) are not included: heat on such a node
changes its temperature at once, so the node is not a state.
"""

from __future__ import annotations

import pandas as pd

from .network import RCNetwork

_PAPER = "Ham and Kim, Hybrid modeling approach for better identification of building thermal network model"
_BACHER = "Bacher and Madsen 2011, Energy and Buildings 43(7), 1511-1522, doi:10.1016/j.enbuild.2011.02.005"
_MADSEN = "Madsen and Holst 1995, Energy and Buildings 22(1), 67-79"

#: resistors with their ends
_RESISTORS = {
    "R_zm": ("za", "m"),
    "R_zw": ("za", "w"),
    "R_ze": ("za", "e"),
    "R_zh": ("za", "h"),
    "R_zs": ("za", "s"),
    "R_wo": ("w", "T_oa"),
    "R_eo": ("e", "T_oa"),
    "R_zo": ("za", "T_oa"),
}
#: bounds of heater and sensor, which are lighter than the paper's bounds allow
_LIGHT = {"C_h": (0.01, 40.0), "R_zh": (0.01, 40.0), "C_s": (0.001, 1.0)}


def _network(
    name: str, nodes: str, resistors: str, description: str, sun: str = "", reference: str = _BACHER
) -> RCNetwork:
    """Network with these nodes, ``za`` and these resistors, with the remainder of the sun on the node ``sun``."""
    others = nodes.split()
    return RCNetwork(
        name,
        {**{node: f"C_{node}" for node in others}, "za": "C_za"},
        {name: _RESISTORS[name] for name in resistors.split()},
        {"za": "f", sun: None} if sun else {"za": None},
        measured="s" if "s" in others else "za",
        heated="h" if "h" in others else "za",
        bounds={name: bounds for name, bounds in _LIGHT.items() if name[-1] in others},
        description=description,
        reference=reference,
    )


_HAM = f"{_PAPER}, Eq. 1; two time constants as in {_MADSEN}"
_SIMPLE = (
    _network("1R1C", "", "R_zo", "a single node (Bacher and Madsen's Ti)"),
    _network("2R2C", "w", "R_zw R_zo", "zone air and a wall mass that is not connected to the outside", "w", _HAM),
    _network(
        "3R2C",
        "w",
        "R_zw R_wo R_zo",
        "zone air, an envelope, and windows in parallel (Bacher and Madsen's TiTeAeRia)",
        "w",
    ),
    _network(
        "3R3C",
        "w m",
        "R_zm R_zw R_wo",
        "zone air, inner mass and envelope (Bacher and Madsen's TiTmTe, with sun on the mass)",
        "m",
    ),
    _network("4R3C", "w m", "R_zm R_zw R_wo R_zo", "3R3C with windows in parallel with the envelope", "m"),
)

_FAMILY = (
    _network("TiTe", "e", "R_ze R_eo", "zone air and an envelope"),
    _network("TiTm", "m", "R_zm R_zo", "zone air and an internal medium"),
    _network("TiTh", "h", "R_zh R_zo", "zone air and a heater that warms up first"),
    _network("TiTs", "s", "R_zs R_zo", "zone air and a sensor that lags"),
    _network("TiTmTe", "m e", "R_zm R_ze R_eo", "zone air, medium and envelope"),
    _network("TiTmTh", "m h", "R_zm R_zh R_zo", "zone air, medium and heater"),
    _network("TiTeTh", "e h", "R_ze R_zh R_eo", "zone air, envelope and heater"),
    _network("TiTeThRia", "e h", "R_ze R_zh R_eo R_zo", "TiTeTh with windows in parallel with the envelope"),
    _network("TiTeThAeRia", "e h", "R_ze R_zh R_eo R_zo", "TiTeThRia with sun on the envelope", sun="e"),
    _network("TiTmTeTh", "m e h", "R_zm R_ze R_zh R_eo", "zone air, medium, envelope and heater"),
    _network("TiTeThTs", "e h s", "R_ze R_zh R_zs R_eo", "zone air, envelope, heater and a sensor that lags"),
    _network("TiTmTeThTsAeRia", "m e h s", "R_zm R_ze R_zh R_zs R_eo R_zo", "the full model of the family", sun="e"),
)

CATALOGUE: dict[str, RCNetwork] = {network.name: network for network in (*_SIMPLE, *_FAMILY)}  # the networks by name


def get_network(network: str | RCNetwork, argument: str = "network") -> RCNetwork:
    """Look up a network by its name in the catalogue; a network is returned as it is.

    Parameters
    ----------
    network : str or RCNetwork
    argument : str
        What an error calls it.

    Raises
    ------
    ValueError
        If the catalogue has no such name.
    """
    if isinstance(network, RCNetwork):
        return network
    if not isinstance(network, str) or network not in CATALOGUE:
        known = ", ".join(CATALOGUE)
        raise ValueError(f"{argument}={network!r} is not in the catalogue: {known}; or pass an RCNetwork.")
    return CATALOGUE[network]


def list_networks() -> pd.DataFrame:
    """One row per network of the catalogue, by name: states, sizes under its usual inputs, description, reference."""
    nets = CATALOGUE.values()
    rows = [(n.name, n.states, len(n.resistors), len(n.parameters()), n.description, n.reference) for n in nets]
    columns = ["name", "states", "n_resistors", "n_parameters", "description", "reference"]
    return pd.DataFrame(rows, columns=columns).set_index("name")
