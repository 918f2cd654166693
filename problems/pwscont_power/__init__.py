"""AC power flow with reactive limits and a loading parameter, a plug-in of pwscont."""

from pwscont_power.flow import PowerFlow
from pwscont_power.network import Branch, Generator, Network
from pwscont_power.read import from_matpower, from_pandapower

__all__ = ["Branch", "Generator", "Network", "PowerFlow", "from_matpower", "from_pandapower"]
