"""The networks that have a name."""

from __future__ import annotations

from .network import RCNetwork

_SPLIT = {"za": "f", "w": None}

#: every network of the catalogue, by name
CATALOGUE: dict[str, RCNetwork] = {
    network.name: network
    for network in (
        RCNetwork("1R1C", {"za": "C_za"}, {"R_zo": ("za", "T_oa")}, {"za": None}),
        RCNetwork("2R2C", {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}, _SPLIT),
        RCNetwork(
            "3R2C",
            {"w": "C_w", "za": "C_za"},
            {"R_zw": ("za", "w"), "R_wo": ("w", "T_oa"), "R_zo": ("za", "T_oa")},
            _SPLIT,
        ),
        RCNetwork(
            "3R3C",
            {"w": "C_w", "m": "C_m", "za": "C_za"},
            {"R_zm": ("za", "m"), "R_zw": ("za", "w"), "R_wo": ("w", "T_oa")},
            {"za": "f", "m": None},
        ),
        RCNetwork(
            "4R3C",
            {"w": "C_w", "m": "C_m", "za": "C_za"},
            {"R_zm": ("za", "m"), "R_zw": ("za", "w"), "R_wo": ("w", "T_oa"), "R_zo": ("za", "T_oa")},
            {"za": "f", "m": None},
        ),
    )
}


def get_network(network: str | RCNetwork) -> RCNetwork:
    """The network of a name, or the network itself.

    Parameters
    ----------
    network : str or RCNetwork

    Returns
    -------
    RCNetwork

    Raises
    ------
    ValueError
        If no network has that name.
    """
    if isinstance(network, RCNetwork):
        return network
    if network not in CATALOGUE:
        raise ValueError(f"network={network!r} is not in the catalogue: {', '.join(CATALOGUE)}; or pass an RCNetwork.")
    return CATALOGUE[network]
