"""RC networks: a declaration with its checks, its matrices and its display, in h, kWh/K, K/kW and kW."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, singledispatch
from html import escape
from typing import Any

import pandas as pd

from .._arguments import check_rate
from ..filtering import Discrete, discretize
from .checks import check
from .declaration import Declaration, as_names
from .equations import equations
from .matrices import Continuous, MatrixBuilder


@singledispatch
def diagram(network: Declaration) -> str:
    """SVG that a notebook shows; ``drawing`` registers :func:`~skhybrid.thermal.draw` here, as it imports networks."""
    raise NotImplementedError(f"no diagram is registered for {type(network).__name__}.")


@dataclass(frozen=True)
class RCNetwork(Declaration):
    """A thermal network declared as data.

    Parameters
    ----------
    name : str
        Such as ``"2R2C"``.
    capacitances : mapping of node to parameter
        The nodes, in the order of the states, and the parameter [kWh/K] of each.
    resistors : mapping of parameter to (end, end)
        Resistances [K/kW].  An end is a node or a boundary temperature, such as ``T_oa``.
    solar : mapping of node to fraction parameter or None, str, tuple of str, or mapping of role to these
        Where solar heat goes: the named fraction [-] to a node, and the remainder to the node whose fraction is None.
        With several windows, a mapping of role to node or to such shares, ``{"q_sol_north": "north", ...}``, or a tuple
        of nodes, each with its own role ``q_sol_<node>``.  Other irradiance columns are not read.  A role of several
        windows has a mapping of area to such a target, ``{"q_sol": {"A_win_north": "north", "A_win_south": ...}}``.
    measured, disturbed : str or tuple of str
        The nodes whose temperature is measured, and those that unmeasured heat enters.
    heated : str, tuple of str, or mapping
        The node that all heating and cooling acts on; a tuple of nodes, where the role names the node
        (``u_heat_north``, ``Q_north``); shares as in ``solar``; or a mapping of role to node, shares or capacities
        (``{"u_heat": {"Q_h_north": "north", ...}}``).  A column of heating or cooling whose node remains unclear is
        refused.
    bounds : mapping of parameter to (lower, upper), optional
        Overrides the paper's bounds.  Those of areas and capacities whose column a log lacks are not used.
    description, reference : str, optional
        Purpose of the network, and its source.
    zones : mapping of zone to tuple of nodes, optional
        Rooms, each with one measured and one disturbed node, by which temperatures (``T_za_<zone>``) and gains are
        named; see :func:`~skhybrid.thermal.building_network`.

    Raises
    ------
    ValueError
        If a name is used twice, an end is neither a node nor a boundary, nodes are connected to no boundary or to no
        measured node, shares are unclear, or bounds are impossible.  The message names the culprit.

    Notes
    -----
    Paper Eq. 1 is ``RCNetwork("2R2C", {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za",
    "T_oa")}, {"za": "f", "w": None})``.

    Examples
    --------
    >>> from skhybrid.thermal import RCNetwork
    >>> shed = RCNetwork("shed", {"za": "C_za"}, {"R_zo": ("za", "T_oa")}, {"za": None})
    >>> print(shed.equations())
    C_za dT_za/dt = (T_oa - T_za)/R_zo + A_win q_sol + Q_h u_heat + Q_c u_cool + Q_g

    Two rooms, each with a thermostat, a window, a heater and people:

    >>> rooms = ("north", "south")
    >>> flat = RCNetwork(
    ...     "flat",
    ...     capacitances={"north": "C_n", "south": "C_s"},
    ...     resistors={"R_ns": ("north", "south"), "R_no": ("north", "T_oa"), "R_so": ("south", "T_oa")},
    ...     solar=rooms, measured=rooms, disturbed=rooms, heated=rooms,
    ... )
    >>> flat.inputs(["T_oa", "q_sol_north", "q_sol_south", "u_heat_north", "Q_south"])
    ('T_oa', 'q_sol_north', 'q_sol_south', 'u_heat_north', 'Q_south')
    >>> flat.gain_names
    ('heat_gain_north', 'heat_gain_south')
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self)

    def matrices(self, theta: Mapping[str, float], roles: Iterable[str]) -> Continuous:
        """Continuous state-space matrices and their derivatives.

        Parameters
        ----------
        theta : mapping of parameter to value
        roles : iterable of str
            The inputs; columns of B are in the order of :meth:`inputs`, then 1 kW of each of :attr:`gain_names`.
            Derivatives are in the order of :meth:`parameters`.

        Raises
        ------
        ValueError
            If a parameter has no value, or an impossible one.
        """
        builder = self.matrix_builder(roles)
        return Continuous(*(batch[0] for batch in builder.matrices(builder.vector(theta)[None])))

    def matrix_builder(self, roles: Iterable[str]) -> MatrixBuilder:
        """Builder of the matrices of many parameter vectors at once; made once per set of inputs.

        Parameters
        ----------
        roles : iterable of str
        """
        key = tuple(sorted(set(as_names(roles))))
        if key not in self._matrix_builders:
            self._matrix_builders[key] = MatrixBuilder.from_network(self, key)
        return self._matrix_builders[key]

    @cached_property
    def _matrix_builders(self) -> dict[tuple[str, ...], MatrixBuilder]:
        return {}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_matrix_builders"}

    def discrete(self, theta: Mapping[str, float], roles: Iterable[str], dt: float) -> Discrete:
        """Exact zero-order hold: ``A``, ``B`` over one step, and their derivatives with respect to the parameters.

        Parameters
        ----------
        theta : mapping of parameter to value
        roles : iterable of str
        dt : float; step [h]
        """
        check_rate("dt", dt)
        c = self.matrices(theta, roles)
        return discretize(c.A, c.B, c.dA, c.dB, c.capacitance, dt)

    def parameter_table(self, roles: Iterable[str] | None = None) -> pd.DataFrame:
        """Unit, bounds, scale and description of every parameter under the given inputs, one row per name.

        Parameters
        ----------
        roles : iterable of str, default :attr:`usual_roles`
        """
        columns = ["name", "unit", "lower", "upper", "transform", "description"]
        rows = [[getattr(parameter, column) for column in columns] for parameter in self.parameters(roles)]
        return pd.DataFrame(rows, columns=columns).set_index("name")

    def equations(self, roles: Iterable[str] | None = None, *, latex: bool = False) -> str:
        """Heat balance of every node, one line each, in the paper's form.

        Parameters
        ----------
        roles : iterable of str, default :attr:`usual_roles`
        latex : bool; return the lines of an ``aligned`` environment instead of text
        """
        return equations(self, roles, latex=latex)

    def _repr_svg_(self) -> str:
        return diagram(self)

    def _repr_html_(self) -> str:
        title = escape(f"{self.name}: {self.description}" if self.description else self.name)
        return (
            f"<div><p><b>{title}</b></p>{diagram(self)}<pre>{escape(self.equations())}</pre>"
            f"{self.parameter_table().to_html(border=0)}</div>"
        )

    def __str__(self) -> str:
        title = f"{self.name}: {len(self.resistors)} resistors, {len(self.capacitances)} capacitances"
        lines = [title, *(text for text in (self.description, self.reference) if text), "", self.equations(), ""]
        return "\n".join([*lines, self.parameter_table().to_string()])
